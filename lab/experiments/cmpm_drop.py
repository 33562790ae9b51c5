"""A stiff CMPM sphere that falls onto the floor, with leapfrog or implicit Euler."""

from __future__ import annotations

import warnings
from functools import cache

from lab.experiments.experiment import Numbers
from taichi_soft import Body, FrozenBodyWarning, Material, TetMesh, UnstableStepWarning, World, sphere
from taichi_soft.core.types import IntegratorName

MATERIAL = Material(young=7.0e9, poisson=0.3, density=1000.0, damping=4000.0, damping_ratio=0.0)
"""So stiff that leapfrog needs steps of about 1e-4 s. Without damping this law gains energy at any step."""

RADIUS, HEIGHT = 1.0, 1.5
"""Of the sphere and of its centre at the start [m]."""

FRAME, FRAMES = 0.06, 12
TOUCHES = 0.25
"""Time [s] at which the sphere is still in the air; it falls 0.5 m in 0.32 s."""

OFF, SHRUNK = 0.05, 0.9
"""Of what is whole: the fall deviates by less than this [m], and the volume stays above this part of its
own."""

BOUNCE = 0.5
"""Part of the bounce of a fall with short steps that one has to keep to be sound."""


@cache
def _mesh(resolution: int) -> TetMesh:
    """Of the sphere; its Voronoi graph takes as long as a fall."""
    return sphere(RADIUS, resolution)


class Drop:
    """A sphere above the floor."""

    def __init__(self, integrator: IntegratorName, factor: float, resolution: int) -> None:
        self.world = World(integrator=integrator, retries=0)
        mesh = _mesh(resolution)
        self.rest_volume = mesh.volume
        self.body: Body = self.world.add_body(mesh, MATERIAL, law="cmpm", position=(0.0, 0.0, HEIGHT))
        self.world.build()
        self.limit = self.body.stable_step.limit
        self.substeps = max(1, round(FRAME / (factor * self.limit)))

    def frame(self) -> None:
        """Go on by `FRAME`."""
        self.world.step(FRAME, self.substeps)


def fall(drop: Drop) -> Numbers:
    """Height [m] frame by frame, and what becomes of the body."""
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
    """How far the sphere bounces off the floor, from its heights frame by frame [m]."""
    return max(0.0, max(height[round(TOUCHES / FRAME) + 1 :]) - RADIUS)


def bounces(numbers: Numbers, reference: list[float]) -> bool:
    """Whether it bounces about as high as it should."""
    return rebound(numbers["height"]) >= BOUNCE * rebound(reference)


def is_whole(numbers: Numbers, reference: list[float]) -> bool:
    """Whether the sphere fell as it should, stayed whole, and lies or bounces on the floor at the end."""
    air = [i for i in range(FRAMES) if (i + 1) * FRAME < TOUCHES]
    off = max(abs(numbers["height"][i] - reference[i]) for i in air)
    whole = not numbers["frozen"] and numbers["flipped"] == 0 and numbers["least_volume"] > SHRUNK
    return bool(whole and off < OFF and numbers["height"][-1] > 0.9 * RADIUS)
