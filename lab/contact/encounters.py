"""Random encounters: two bodies of random shapes hit each other, without gravity and walls.

Whatever they do, physics requires that they do not pass through each other, that momentum and angular
momentum are conserved, and that contact makes no energy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.contact.geometry import depth_through, may_touch, overlap, rope_distance
from taichi_soft import (
    Body,
    Contact,
    Material,
    ParticleMesh,
    ShellMaterial,
    SoftBodyAsset,
    SpringMaterial,
    TetMesh,
    World,
    box,
    sheet,
    sphere,
)

Floats = NDArray[np.float64]

LONGEST, STRIDE = 1.0 / 240.0, 0.01
"""Longest step [s], and largest approach in a step [m]. The overlap is measured after each step, so that no
body can pass another one unseen."""

HARD = Material(young=5e8, poisson=0.3, density=1000.0)
FIRM = Material(young=2e7, poisson=0.3, density=500.0)

CANVAS = ShellMaterial(young=2e7, poisson=0.3, density=500.0, thickness=0.005)
CORD = SpringMaterial(stiffness=1e4, damping=0.5)

THICKNESS = 0.02
"""Thickness of sheets and ropes in contact [m]. It is twice `STRIDE`, so that nothing passes them between two
measurements."""

THROUGH = 0.01
"""Limit for the depth of edges in a sheet, and for how much nearer than `THICKNESS` two ropes come [m]. What
passes a rope comes 15 mm nearer, and what passes a sheet of cells of 8 cm is seen deeper than this."""

SLOWEST, FASTEST = 1.0, 200.0
"""Range of the speeds of approach [m/s]."""

DEEPEST, DENT = 0.02, 1e-4
"""Largest overlap of a slow encounter [m], and its increase with speed [m/(m/s)]. The first is a seventh of
the longest edges: see `SHARP_COSINE` of `taichi_soft.bodies.contact_edges`. The second is for impacts nearly
as fast as sound in the material."""

NOISE, TORQUE_NOISE = 3.0, 150.0
"""Speeds [m/s] that are added to the speed of approach before a change of momentum, or of angular momentum,
is compared with it. Rounding errors of the elastic forces do not depend on the speed. The angular momentum of
a wedge that flies freely at 1 m/s changes by 1e-4 in a second."""


def _needle() -> TetMesh:
    """Return a long pyramid with a tip of 2 degrees."""
    base, tip = 0.02, 0.6
    corners = [(-base, -base, 0), (base, -base, 0), (base, base, 0), (-base, base, 0), (0, 0, tip)]
    return TetMesh(np.array(corners) - (0, 0, 0.25 * tip), [(0, 1, 2, 4), (0, 2, 3, 4)])


def _wedge() -> TetMesh:
    """Return a wedge with a sharp edge, whose tetrahedra are slivers."""
    mesh = box((0.4, 0.4, 0.2), (3, 3, 1))
    x = mesh.vertices.copy()
    x[:, 2] *= np.clip(0.5 - x[:, 0] / 0.4, 0.05, 1.0)
    return TetMesh(x, mesh.tets)


def _solid(mesh: TetMesh, material: Material) -> SoftBodyAsset:
    return SoftBodyAsset(mesh, material, contact=Contact(friction=0.3))


def _sheet() -> SoftBodyAsset:
    contact = Contact(friction=0.3, thickness=THICKNESS)
    return SoftBodyAsset(sheet((0.5, 0.5), (6, 6)), CANVAS, contact=contact)


def _knot() -> SoftBodyAsset:
    """Return a closed rope in the shape of a trefoil knot."""
    t = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    x, y, z = np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)
    numbers = np.arange(60)
    mesh = ParticleMesh(
        0.1 * np.stack([x, y, z], axis=1), np.stack([numbers, (numbers + 1) % 60], axis=1), np.full(60, 0.01)
    )
    return SoftBodyAsset(
        mesh, CORD, law="springs", contact=Contact(friction=0.3, thickness=THICKNESS, itself=True)
    )


SHAPES: dict[str, Callable[[], SoftBodyAsset]] = {
    "ball": lambda: _solid(sphere(radius=0.15, resolution=2), HARD),
    "cube": lambda: _solid(box((0.25, 0.25, 0.25), (2, 2, 2)), FIRM),
    "bar": lambda: _solid(box((0.8, 0.1, 0.1), (6, 1, 1)), HARD),
    "plate": lambda: _solid(box((0.5, 0.5, 0.04), (4, 4, 1)), FIRM),
    "needle": lambda: _solid(_needle(), HARD),
    "wedge": lambda: _solid(_wedge(), FIRM),
    "sheet": _sheet,
    "knot": _knot,
}


@dataclass(frozen=True)
class Encounter:
    """Result of one encounter."""

    seed: int
    shapes: tuple[str, str]
    speed: float  # of the approach [m/s]
    have_met: bool  # True if the velocities of the bodies changed
    overlap: float  # largest depth of an edge in the other body [m]
    through: float  # largest depth of an edge in a sheet, or of a rope in the skin of another one [m]
    are_apart: bool  # True if the bodies did not touch in the last steps
    energy: float  # kinetic and elastic energy at the end, relative to the start
    momentum: float  # change, relative to the total mass times the speed and `NOISE`
    angular_momentum: (
        float  # change, relative to the same with `TORQUE_NOISE`, times the distance at the start
    )
    is_frozen: bool
    are_finite: bool

    @property
    def is_good(self) -> bool:
        """True if the encounter is as physics requires."""
        is_whole = self.are_finite and not self.is_frozen and self.energy < 1.001
        # While bodies touch, the velocities that can be read are not all of the same moment.
        # A rope can touch itself even then: 8e-6 was read where the stored velocities kept it to 6e-8.
        limit = 2e-5 if "knot" in self.shapes else 1e-6
        is_kept = not self.are_apart or max(self.momentum, self.angular_momentum) < limit
        is_outside = self.overlap < DEEPEST + DENT * self.speed and self.through < THROUGH
        return is_whole and is_kept and is_outside


def _turn(rng: np.random.Generator) -> Floats:
    q = rng.normal(size=4)
    unit: Floats = q / np.linalg.norm(q)
    return unit


class Arena:
    """A world in which any two shapes can meet, one pair after the other."""

    def __init__(self) -> None:
        self.world = World(gravity=(0, 0, 0), floor=None, sleep_speed=0)
        self.assets: dict[str, SoftBodyAsset] = {}
        for name, make in SHAPES.items():
            self.assets[name] = make()
            self.world.reserve(self.assets[name], 2)
        self.world.build()

    def meet(self, seed: int) -> Encounter:
        """Let two random shapes meet."""
        rng = np.random.default_rng(seed)
        names = [list(SHAPES)[k] for k in rng.integers(len(SHAPES), size=2)]
        speed = float(np.exp(rng.uniform(np.log(SLOWEST), np.log(FASTEST))))
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        aside = rng.normal(size=3) * 0.02
        radii = [np.linalg.norm(self.assets[name].mesh.vertices, axis=1).max() for name in names]
        distance = sum(radii) + 0.03
        first = self.world.spawn(self.assets[names[0]], position=(0, 0, 0), rotation=_turn(rng))
        second = self.world.spawn(
            self.assets[names[1]], position=distance * way + aside, rotation=_turn(rng), velocity=-speed * way
        )
        bodies = [first, second]
        before = _Kept.of(bodies)
        mass = float(first.masses.sum() + second.masses.sum())
        dt, calm, momentum = min(LONGEST, STRIDE / speed), 0, first.momentum()
        deepest, farthest = 0.0, 0.0
        for _ in range(int(np.ceil(2.0 * distance / (speed * dt)))):
            self.world.step(dt)
            if may_touch(first, second, THICKNESS):
                deepest = max(deepest, overlap(first, second))
                farthest = max(farthest, _depth_through(first, second))
            momentum, last = first.momentum(), momentum
            calm = calm + 1 if np.abs(momentum - last).max() < 1e-6 * mass * speed else 0
        after = _Kept.of(bodies)
        x = np.concatenate([body.positions() for body in bodies])
        result = Encounter(
            seed,
            (names[0], names[1]),
            speed,
            have_met=bool(np.abs(momentum).max() > 1e-4 * mass * speed),
            overlap=deepest,
            through=farthest,
            are_apart=calm > 3,
            energy=after.energy / before.energy,
            momentum=float(np.abs(after.momentum - before.momentum).max()) / (mass * (speed + NOISE)),
            angular_momentum=float(np.abs(after.angular - before.angular).max())
            / (mass * (speed + TORQUE_NOISE) * distance),
            is_frozen=any(body.is_frozen for body in bodies),
            are_finite=bool(np.isfinite(x).all()),
        )
        for body in bodies:
            self.world.despawn(body)
        return result


def _depth_through(first: Body, second: Body) -> float:
    """Return the depth in a sheet or in the skin of a rope, as `Encounter` describes it [m]."""
    if not (len(first.surface) or len(second.surface)):
        return max(THICKNESS - rope_distance(first, second), 0.0)
    pairs = (first, second), (second, first)
    sheets = [pair for pair in pairs if len(pair[0].surface) and not len(pair[0].tets)]
    return max((depth_through(sheet, other) for sheet, other in sheets), default=0.0)


@dataclass(frozen=True)
class _Kept:
    """Quantities that an encounter conserves, or must not increase."""

    momentum: Floats
    angular: Floats
    energy: float

    @classmethod
    def of(cls, bodies: list[Body]) -> _Kept:
        momentum = sum((body.momentum() for body in bodies), np.zeros(3))
        angular = sum((body.angular_momentum() for body in bodies), np.zeros(3))
        energy = sum(body.kinetic_energy() + body.elastic_energy() for body in bodies)
        return cls(momentum, angular, energy)
