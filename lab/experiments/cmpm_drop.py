"""Drop a sphere onto the floor with leapfrog or implicit Euler. The default is a stiff sphere under CMPM."""

from __future__ import annotations

import warnings
from functools import cache

from lab.experiments.experiment import Numbers
from taichi_soft import Body, FrozenBodyWarning, Material, TetMesh, UnstableStepWarning, sphere
from taichi_soft.core.types import IntegratorName, LawName
from taichi_soft.world.bare import bare_world

MATERIAL = Material(young=7.0e9, poisson=0.3, density=1000.0, damping=4000.0, damping_ratio=0.0)
"""Material so stiff that leapfrog needs steps of about 1e-4 s. The material is damped, because undamped CMPM
gains energy at any step length."""

RADIUS, HEIGHT = 1.0, 1.5
"""Radius of the sphere, and initial height of its centre [m]."""

FRAME, FRAMES = 0.06, 12
TOUCHES = 0.25
"""Time at which the sphere is still in the air [s]. It reaches the floor after 0.32 s."""

OFF, SHRUNK = 0.05, 0.9
"""Limits of a valid fall. `OFF` is the largest deviation from the reference in the air [m]. `SHRUNK` is the
smallest volume, as a fraction of the rest volume."""

BOUNCE = 0.5
"""A bounce counts as preserved if its height is at least this fraction of the bounce of the reference."""


@cache
def _mesh(resolution: int) -> TetMesh:
    """Make the mesh of the sphere.

    The mesh is cached, because its Voronoi graph takes as long to compute as a fall.
    """
    return sphere(RADIUS, resolution)


class Drop:
    """A world with a sphere above the floor."""

    def __init__(
        self,
        integrator: IntegratorName,
        factor: float,
        resolution: int,
        *,
        law: LawName = "cmpm",
        material: Material = MATERIAL,
    ) -> None:
        """Build the world.

        Args:
            factor: length of a step, as a multiple of leapfrog's largest stable step.
            resolution: resolution of the mesh, see `sphere`.
        """
        self.world = bare_world(integrator=integrator, retries=0)
        mesh = _mesh(resolution)
        self.rest_volume = mesh.volume
        self.body: Body = self.world.add_body(mesh, material, law=law, position=(0.0, 0.0, HEIGHT))
        self.world.build()
        self.limit = self.body.stable_step.limit
        self.substeps = max(1, round(FRAME / (factor * self.limit)))

    def frame(self) -> None:
        """Simulate one frame."""
        self.world.step(FRAME, self.substeps)


def fall(drop: Drop) -> Numbers:
    """Simulate a fall.

    Returns: height in each frame [m], smallest volume as a fraction of the rest volume, largest number of
        inverted tetrahedra, and whether the body froze.
    """
    height, volume, flipped = [], [], 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnstableStepWarning)
        warnings.simplefilter("ignore", FrozenBodyWarning)
        for _ in range(FRAMES):
            drop.frame()
            height.append(round(float(drop.body.center_of_mass()[2]), 5))
            volume.append(drop.body.volume() / drop.rest_volume)
            flipped = max(flipped, drop.body.flipped_count())
    return {
        "limit": drop.limit,
        "step": FRAME / drop.substeps,
        "height": height,
        "least_volume": min(volume),
        "flipped": flipped,
        "frozen": drop.body.is_frozen,
    }


def rebound(height: list[float]) -> float:
    """Return the largest height of the centre after the impact, above its height at rest on the floor [m].

    Args:
        height: height of the centre in each frame [m].
    """
    return max(0.0, max(height[round(TOUCHES / FRAME) + 1 :]) - RADIUS)


def bounces(numbers: Numbers, reference: list[float]) -> bool:
    """True if the height of the bounce is at least `BOUNCE` times that of the reference."""
    return rebound(numbers["height"]) >= BOUNCE * rebound(reference)


def is_whole(numbers: Numbers, reference: list[float]) -> bool:
    """True if the sphere falls like the reference, stays valid, and is on or above the floor at the end."""
    air = [i for i in range(FRAMES) if (i + 1) * FRAME < TOUCHES]
    off = max(abs(numbers["height"][i] - reference[i]) for i in air)
    whole = not numbers["frozen"] and numbers["flipped"] == 0 and numbers["least_volume"] > SHRUNK
    return bool(whole and off < OFF and numbers["height"][-1] > 0.9 * RADIUS)
