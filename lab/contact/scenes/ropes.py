"""Ropes with a thickness."""

from __future__ import annotations

import numpy as np

from lab.contact.criteria import Finally, Most, whole
from lab.contact.geometry import rope_distance
from lab.contact.scene import Scene, Stage
from lab.contact.scenes.bodies import CORD, RUBBER
from taichi_soft import (
    Body,
    BoxShape,
    CapsuleShape,
    Contact,
    ParticleMesh,
    SpringMaterial,
    World,
    box,
    rope,
    torus,
)

THICKNESS = 0.02
"""Thickness of all ropes [m]."""


def _distance(first: Body, second: Body | None = None, skip: int = 0) -> Most:
    """Return the criterion that two ropes never come closer than half a thickness."""
    other = first if second is None else second
    return Most(
        "overlap",
        lambda: 1e3 * (THICKNESS - rope_distance(first, other, skip)),
        1e3 * THICKNESS / 2,
        "mm",
        every=2,
    )


def _over() -> Stage:
    world = World(floor=None)
    mesh, contact = rope(2.0, 40, 0.5), Contact(thickness=THICKNESS)
    line = world.add_body(mesh, CORD, pinned=[0, 40], contact=contact)
    across = ParticleMesh(mesh.vertices[:, [1, 0, 2]], mesh.edges, mesh.masses)
    other = world.add_body(across, CORD, position=(0.07, 0.02, 0.2), contact=contact)
    hangs = Finally(
        "highest point over the line's lowest",
        lambda: float(other.positions()[:, 2].max() - line.positions()[:, 2].min()),
        0.0,
        np.inf,
        "m",
    )
    return Stage(world, (_distance(line, other), hangs, whole([line, other])))


def _coarse() -> Stage:
    world = World(floor=None)
    mesh, contact = rope(2.0, 10, 0.5), Contact(thickness=THICKNESS)
    line = world.add_body(mesh, CORD, pinned=[0, 10], contact=contact)
    across = ParticleMesh(mesh.vertices[:, [1, 0, 2]], mesh.edges, mesh.masses)
    other = world.add_body(across, CORD, position=(0.07, 0.05, 0.2), contact=contact)
    return Stage(world, (_distance(line, other), whole([line, other])))


def _knot() -> Stage:
    """A rope in the shape of an overhand knot, whose ends are pulled apart."""
    t = np.linspace(-0.92 * np.pi, 0.92 * np.pi, 121)  # most of a trefoil knot
    loop = 0.12 * np.stack(
        [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1
    )
    length = np.linalg.norm(np.diff(loop, axis=0), axis=1).sum()
    numbers = np.arange(len(loop) - 1)
    mesh = ParticleMesh(
        loop, np.stack([numbers, numbers + 1], axis=1), np.full(len(loop), 0.2 * length / len(loop))
    )
    world = World(floor=None, gravity=(0, 0, 0))
    body = world.add_body(
        mesh,
        SpringMaterial(stiffness=2000.0, damping=1.0),
        pinned=[0, len(loop) - 1],
        contact=Contact(thickness=THICKNESS, itself=True, friction=0.3),
    )
    world.build()
    ends = body.positions()[[0, -1]].astype(float)
    away = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])

    def pull(time: float) -> None:
        shift = min(time, 2.5) * 0.25
        body.set_targets([0, len(loop) - 1], np.array([ends[0] - shift * away, ends[1] + shift * away]))

    def straightness() -> float:
        x = body.positions().astype(float)
        along = x[-1] - x[0]
        return float(np.linalg.norm(np.diff(x, axis=0), axis=1).sum() / np.linalg.norm(along))

    # A rope that has come through itself is straight: its length is the distance of its ends.
    holds = Finally("length over the distance of the ends", straightness, 1.05, np.inf, "")
    return Stage(world, (_distance(body, skip=4), holds, whole([body])), pull)


def _capstan() -> Stage:
    """A rope of half a turn over a fixed drum, with a load on one side and a hand on the other."""
    friction, radius, count = 0.3, 0.2, 80
    world = World(floor=None)
    angles = np.linspace(np.pi, 0.0, 41)
    arc = (radius + 0.5 * THICKNESS) * np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    step = np.linalg.norm(arc[1] - arc[0])
    left = arc[0] - np.arange(20, 0, -1)[:, None] * [0, 0, step]
    right = arc[-1] - np.arange(1, 21)[:, None] * [0, 0, step]
    points = np.concatenate([left, arc, right])
    numbers = np.arange(count)
    mesh = ParticleMesh(points, np.stack([numbers, numbers + 1], axis=1), np.full(count + 1, 0.001))
    body = world.add_body(
        mesh,
        SpringMaterial(stiffness=5000.0, damping=2.0),
        pinned=[count],
        contact=Contact(thickness=THICKNESS, friction=friction),
    )
    world.add_collider(
        CapsuleShape(radius=radius, length=1.0),
        rotation=(np.sqrt(0.5), 0, 0, np.sqrt(0.5)),
        friction=friction,
    )
    world.build()
    end = body.positions()[count].astype(float)

    def lower(time: float) -> None:
        # The hand lets the load down slowly, so that the rope slides in one direction.
        body.apply_force((0, 0, -20.0), particles=[0])
        body.set_targets([count], end[None] + np.array([0, 0, 0.05 * max(time - 0.5, 0.0)]))

    def ratio() -> float:
        x = body.positions().astype(float)
        tension = np.linalg.norm(np.diff(x, axis=0), axis=1) - step
        return float(tension[2] / tension[-3] / np.exp(friction * np.pi))

    return Stage(
        world,
        (Finally("ratio of tensions over exp(mu phi)", ratio, 0.9, 1.1, ""), whole([body])),
        lower,
    )


def _ring() -> Stage:
    world = World(floor=None)
    line = world.add_body(rope(2.0, 40, 0.4), CORD, pinned=[0, 40], contact=Contact(thickness=THICKNESS))
    ring = world.add_body(
        torus(0.12, 0.03),
        RUBBER,
        rotation=(0, np.sqrt(0.5), 0, np.sqrt(0.5)),
        position=(0.0, 0.0, -0.02),
        contact=Contact(friction=0.2),
    )
    # The rope stretches by as much as the weight of the ring demands: 1.1 m below its hold on it.
    falls = Most("fall of the ring", lambda: -float(ring.center_of_mass()[2]), 1.3, "m")
    return Stage(world, (falls, whole([line, ring])))


def _on_shelf() -> Stage:
    world = World(floor=None)
    line = world.add_body(
        rope(1.0, 20, 0.3), CORD, position=(0.05, 0, 0.2), contact=Contact(thickness=THICKNESS)
    )
    world.add_collider(BoxShape((0.4, 0.4, 0.02)), position=(0, 0, 0.0), friction=1.0)
    falls = Most("fall below the shelf's middle", lambda: -float(line.positions()[8:13, 2].max()), 0.0, "m")
    return Stage(world, (falls, whole([line])))


def _over_beam() -> Stage:
    world = World(floor=None)
    block = box((0.3, 1.0, 0.3), (2, 4, 2))
    beam = world.add_body(block, RUBBER, pinned=np.flatnonzero(np.abs(block.vertices[:, 1]) > 0.49))
    line = world.add_body(
        rope(1.6, 24, 0.5),
        CORD,
        position=(0.04, 0.03, 0.3),
        contact=Contact(thickness=THICKNESS, friction=0.8),
    )
    falls = Most("fall below the beam", lambda: -0.3 - float(line.positions()[:, 2].max()), 0.0, "m")
    return Stage(world, (falls, whole([beam, line])))


SCENES = (
    Scene("rope over rope", "A rope falls on a rope and hangs over it.", 3.0, _over),
    Scene("coarse rope over rope", "The same with segments of ten thicknesses.", 3.0, _coarse),
    Scene("knot", "The ends of a rope with an overhand knot are pulled apart.", 4.0, _knot),
    Scene("capstan", "A rope slides over a drum, half a turn, under a load.", 4.0, _capstan),
    Scene("ring on a rope", "A ring hangs on a rope.", 3.0, _ring),
    Scene("rope on a shelf", "A rope falls across a thin shelf and hangs over its rims.", 3.0, _on_shelf),
    Scene("rope over a beam", "A rope falls over a coarse soft beam.", 3.0, _over_beam),
)
