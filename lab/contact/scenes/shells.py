"""Shells: cloth and curved sheets with the constants of real materials."""

from __future__ import annotations

import numpy as np

from lab.contact.criteria import AtRest, Finally, Most, whole
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import RUBBER
from taichi_soft import BoxShape, Contact, ShellMaterial, ShellMesh, World, sheet, sphere

LINEN = ShellMaterial(young=5e6, poisson=0.3, density=500, thickness=5e-4, damping=0.02, bending_damping=0.01)
PLASTIC = ShellMaterial(young=1e8, poisson=0.35, density=900, thickness=4e-3, bending_damping=5e-4)
LAYER = 5e-3
"""Thickness in contact of the cloth [m]."""


def _tablecloth() -> Stage:
    world = World(floor=0.0)
    world.add_collider(BoxShape((0.6, 0.6, 0.4)), position=(0, 0, 0.2))
    cloth = world.add_body(
        sheet((1.2, 1.2), (20, 20)),
        LINEN,
        position=(0.05, 0.02, 0.45),
        contact=Contact(itself=True, thickness=LAYER),
    )

    def depth() -> float:
        x = cloth.positions()
        inside = np.minimum(0.3 - np.abs(x[:, :2]).max(axis=1), 0.4 - x[:, 2])
        return 1e3 * float(inside.max())

    return Stage(
        world,
        (
            Most("depth of a vertex in the table", depth, 1.0, "mm"),
            Most("largest stretch", lambda: _stretch(cloth), 5.0, "%"),
            AtRest([cloth], 8.0),
            whole([cloth]),
        ),
    )


def _stretch(body) -> float:  # type: ignore[no-untyped-def]
    """Return the largest relative change of an edge's length [%]."""
    x, edges = body.positions().astype(np.float64), body.mesh.edges
    lengths = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
    return float(100.0 * np.abs(lengths / body.mesh.edge_lengths - 1.0).max())


def _dome() -> ShellMesh:
    """Make a flat dome with a square outline, curved at rest."""
    flat = sheet((0.6, 0.6), (12, 12))
    x = flat.vertices.copy()
    x[:, 2] = 0.25 * np.cos(np.pi * x[:, 0] / 0.6) * np.cos(np.pi * x[:, 1] / 0.6)
    return ShellMesh(x, flat.triangles)


def _ball_on_dome() -> Stage:
    world = World(floor=0.0)
    mesh = _dome()
    dome = world.add_body(mesh, PLASTIC, position=(0, 0, 0.01), contact=Contact(thickness=LAYER))
    ball = world.add_body(sphere(radius=0.06), RUBBER, position=(0.01, 0.02, 0.6))

    def through() -> float:
        """Distance by which the ball's lowest vertex is below the dome's highest one, over the dome [m]."""
        x, low = dome.positions(), ball.positions()
        near = np.linalg.norm(x[:, :2] - ball.center_of_mass()[:2], axis=1) < 0.04
        return float(x[near, 2].max() - low[:, 2].min()) if near.any() else 0.0

    def change() -> float:
        """Return the largest distance of a vertex from the best-fitting rest shape [mm]."""
        pose = dome.pose()
        x = (mesh.vertices - mesh.vertices.mean(axis=0)) @ np.asarray(pose.rotation).T
        now = dome.positions() - dome.positions().mean(axis=0)
        return 1e3 * float(np.linalg.norm(now - x, axis=1).max())

    return Stage(
        world,
        (
            Most("the ball below the dome", through, 0.03, "m"),
            Finally("change of the dome's shape", change, 0.0, 30.0, "mm"),
            whole([dome, ball]),
        ),
    )


def _hammock() -> Stage:
    world = World(floor=None)
    mesh = sheet((1.2, 1.2), (16, 16))
    corners = [0, 16, 16 * 17, 17 * 17 - 1]
    cloth = world.add_body(mesh, LINEN, pinned=corners, contact=Contact(thickness=LAYER))
    ball = world.add_body(sphere(radius=0.1), RUBBER, position=(0.03, 0.02, 0.35))
    fall = Most("fall of the ball", lambda: -float(ball.center_of_mass()[2]), 0.6, "m")
    return Stage(
        world, (fall, Most("largest stretch", lambda: _stretch(cloth), 40.0, "%"), whole([cloth, ball]))
    )


SCENES = (
    Scene("tablecloth", "Cloth of linen falls on a table, and comes to rest in folds.", 10.0, _tablecloth),
    Scene(
        "ball on a dome",
        "A ball falls on a thin plastic dome, which dents and springs back.",
        3.0,
        _ball_on_dome,
    ),
    Scene("ball in a hammock", "A ball falls into cloth that is held at its corners.", 3.0, _hammock),
)
