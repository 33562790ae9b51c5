"""Measure the cost of unused features, of used features, and of contact in a heap of bodies. Each measurement
alternates with a measurement of bodies without the feature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.contact import DEFAULT_CONTACT, Contact
from taichi_soft.contact.shapes import BoxShape
from taichi_soft.core.package_data import ASSETS
from taichi_soft.core.types import LawName
from taichi_soft.elements.materials import preset
from taichi_soft.elements.materials.material import DAMPING_RATIO
from taichi_soft.meshing import TetMesh, box, load_mesh, sphere
from taichi_soft.profiling.spread import Spread, compare, time_calls
from taichi_soft.profiling.stolen import processor_ticks, stolen_since
from taichi_soft.world.bare import bare_world
from taichi_soft.world.body import Body
from taichi_soft.world.world import World

DT, SUBSTEPS = 1 / 60, 12  # 720 substeps per second; the sphere of the thesis has 700
COUNT = 16
SPACING = 3.0  # distance between the centres of spheres of radius 1 [m]
SETTLING = 180
"""Number of frames after which bodies on the floor or in a heap have come to rest."""

UNUSED_FACTOR = 25
"""Factor for the number of measured pairs of steps if a feature is unused. About 300 pairs are needed before
the median can distinguish a ratio of 1.01 from 1.03."""


@dataclass(frozen=True)
class FeatureCost:
    """Ratio of the time of a fixed step with a feature to the time of a step without it, for each pair of
    steps.
    """

    name: str
    is_used: bool
    ratio: Spread


@dataclass(frozen=True)
class Heap:
    """Time of a fixed step of a heap of spheres on all threads."""

    mesh: str
    bodies: int
    tets: int
    threads: int
    step: Spread  # times of consecutive steps [ms]
    real_time: float  # simulated time divided by median step time
    ratio: Spread  # step time divided by the step time of as many free bodies, for each pair of steps
    stolen: float | None  # fraction of the CPU time that the host gave to other machines


@dataclass(frozen=True)
class Moments:
    """Cost of an action that does not happen in every step."""

    name: str  # name of the action, with the unit of `cost`
    cost: Spread


def _mesh() -> TetMesh:
    return sphere(radius=1.0, resolution=4)


def _spheres(
    height: float,
    contact: Contact = DEFAULT_CONTACT,
    law: LawName | None = "virial",
    damping_ratio: float = 0.0,
    **options: Any,
) -> World:
    """Make a grid of spheres with centres at `height` [m]."""
    world = bare_world(**options)
    material = replace(preset("thesis_sphere"), damping_ratio=damping_ratio)
    for i in range(COUNT):
        place = (SPACING * (i % 4), SPACING * (i // 4), height)
        world.add_body(_mesh(), material, position=place, contact=contact, law=law)
    return world


def _stepping(world: World) -> Callable[[], object]:
    if not world.is_built:
        world.build()
    return partial(world.step, DT, SUBSTEPS)


def measure_features(repeats: int = 41) -> list[FeatureCost]:
    """Measure the cost of every feature."""
    high = 1.0e5  # [m], so that the bodies touch nothing while they fall
    free = _stepping(_spheres(high, floor=None))
    found = []

    def against(other: Callable[[], object], name: str, is_used: bool, world: World) -> None:
        pairs = repeats if is_used else UNUSED_FACTOR * repeats
        _, _, ratio = compare(_stepping(world), other, pairs, 1e3)
        found.append(FeatureCost(name, is_used, ratio))

    against(free, "nothing: the same again", False, _spheres(high, floor=None))
    against(free, "room for colliders", False, _spheres(high, floor=None, collider_room=8))
    pooled = _spheres(high, floor=None)
    pooled.reserve(SoftBodyAsset(_mesh(), preset("thesis_sphere")), COUNT)
    against(free, "as many empty slots of a pool", False, pooled)
    spare = bare_world(floor=None)
    asset = SoftBodyAsset(_mesh(), preset("thesis_sphere"), spare_vertices=100)
    spare.reserve(asset, COUNT)
    for i in range(COUNT):
        spare.spawn(asset, position=(SPACING * i, 0.0, high))
    against(free, "room for cuts", False, spare)
    idle = _spheres(high, floor=None)
    _stepping(idle)
    for body in idle.bodies:
        body.apply_force((0.0, 0.0, 1.0))
        body.pin([0])
        body.unpin([0])
    against(free, "forces and pins, no longer used", False, idle)

    ratio = DAMPING_RATIO
    against(free, f"damping_ratio={ratio:g}", True, _spheres(high, floor=None, damping_ratio=ratio))
    default = _spheres(high, law=None, floor=None, damping_ratio=ratio)
    against(free, "the same, and the default law", True, default)
    far = _spheres(high, floor=None)
    for i in range(8):
        far.add_collider(BoxShape((1.0, 1.0, 1.0)), position=(SPACING * i, 0.0, 0.0))
    against(free, "colliders, none near", True, far)
    lonely = _spheres(high, floor=None, soft_contact=True, collider_room=8)
    against(free, "soft contact, nobody near", True, lonely)
    against(free, "flight recorder", True, _spheres(high, floor=None, record=60))
    windy = _spheres(high, floor=None)
    windy.build()
    windy.set_wind((5.0, 0.0, 0.0))
    against(free, "wind", True, windy)
    against(free, "lying on the floor", True, _settled(_spheres(1.0)))
    lying = _settled(_spheres(1.0, collider_room=8))
    against(free, "lying on a collider", True, lying)
    soft = _settled(_spheres(1.0, collider_room=8, soft_contact=True))
    against(free, "lying on a collider, soft contact on", True, soft)
    itself = _spheres(high, Contact(itself=True), floor=None, collider_room=8, soft_contact=True)
    against(free, "touching itself allowed", True, itself)
    asleep = _settled(_spheres(1.0, collider_room=8, soft_contact=True, sleep_speed=0.2), 6 * SETTLING)
    sleeping = sum(body.is_asleep for body in asleep.bodies)
    against(_stepping(soft), f"{sleeping} of {COUNT} asleep, against awake", True, asleep)
    return found


def _settled(world: World, frames: int = SETTLING) -> World:
    step = _stepping(world)
    for _ in range(frames):
        step()
    return world


def measure_heaps(threads: int, repeats: int = 61) -> list[Heap]:
    """Measure heaps of the package's sphere, and of the thesis's sphere if the source checkout is
    available.
    """
    meshes = {"regular": _mesh()}
    if (ASSETS / "sphere.npz").exists():
        meshes = {"thesis": load_mesh(ASSETS / "sphere.npz"), **meshes}
    return [measure_heap(name, mesh, threads, repeats) for name, mesh in meshes.items()]


def measure_heap(name: str, mesh: TetMesh, threads: int, repeats: int = 61) -> Heap:
    """Drop 32 spheres into a pit and time their steps at rest.

    First, only steps of the heap are timed, as in a game with one world. Then steps of the heap alternate
    with steps of as many free spheres. The free spheres evict the heap from the CPU's caches."""
    world = bare_world(collider_room=8, soft_contact=True)
    free = bare_world(floor=None)
    for side in (-1, 1):
        world.add_collider(BoxShape((1.0, 20.0, 6.0)), position=(side * 5.1, 0.0, 3.0))
        world.add_collider(BoxShape((20.0, 1.0, 6.0)), position=(0.0, side * 5.1, 3.0))
    for x, y, z in product(range(4), range(4), range(2)):
        place = (2.2 * (x - 1.5) + 0.1 * z, 2.2 * (y - 1.5) + 0.05 * z, 1.2 + 2.3 * z)
        world.add_body(mesh, preset("thesis_sphere"), position=place, law="virial")
        free.add_body(
            mesh, preset("thesis_sphere"), position=(SPACING * x, SPACING * y, SPACING * z), law="virial"
        )
    heaped, apart = _stepping(_settled(world)), _stepping(free)
    time_calls(heaped, 2)
    before = processor_ticks()
    step = Spread.of(time_calls(heaped, repeats)).scaled(1e3)
    stolen, tets = stolen_since(before), sum(len(body.tets) for body in world.bodies)
    _, _, ratio = compare(heaped, apart, repeats, 1e3)
    return Heap(name, len(world.bodies), tets, threads, step, DT * 1e3 / step.median, ratio, stolen)


def measure_moments(repeats: int = 61) -> list[Moments]:
    """Measure a snapshot, and frames in which a body is spawned or despawned."""
    big = bare_world(floor=None)
    big.add_body(box((1.0, 1.0, 1.0), (10, 10, 10)), preset("thesis_sphere"), law="virial")
    big.build()
    snapshot = Spread.of(_warm(big.snapshot, repeats)).scaled(1e3)
    pool = bare_world(floor=None)
    asset = SoftBodyAsset(_mesh(), preset("thesis_sphere"))
    pool.reserve(asset, COUNT)
    for i in range(COUNT - 1):
        pool.spawn(asset, position=(SPACING * i, 0.0, 10.0))
    step, last = _stepping(pool), list[Body]()

    def come() -> None:
        last.append(pool.spawn(asset, position=(0.0, SPACING, 10.0)))
        step()

    def go() -> None:
        pool.despawn(last.pop())
        step()

    time_calls(come, 1)
    time_calls(go, 1)
    plain, coming, going = [], [], []
    for _ in range(repeats):
        plain += time_calls(step, 1)
        coming += time_calls(come, 1)
        going += time_calls(go, 1)
    median = float(np.median(plain))
    return [
        Moments(f"snapshot of {len(big.bodies[0].tets):,} tetrahedra [ms]", snapshot),
        Moments("frame with a spawn, over the median frame", Spread.of(coming).scaled(1 / median)),
        Moments("frame with a despawn, over the median frame", Spread.of(going).scaled(1 / median)),
        Moments("any other frame, over the median frame", Spread.of(plain).scaled(1 / median)),
    ]


def _warm(call: Callable[[], object], repeats: int) -> list[float]:
    time_calls(call, 3)
    return time_calls(call, repeats)
