"""Measure the speed-up of implicit Euler over leapfrog and over an implementation in scipy.

The comparisons with leapfrog are for CMPM (thesis 4.2) and for a stiff bar, the one with scipy is for a bar.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from taichi_soft.elements.materials import Material
from taichi_soft.meshing import box, sphere
from taichi_soft.profiling.sparse import SparseBody
from taichi_soft.profiling.spread import Spread, compare
from taichi_soft.world.bare import bare_world

GROWTH = 100
"""Ratio of the step lengths of implicit Euler (1e-2 s) and leapfrog (about 1e-4 s) in the thesis."""

CMPM_MATERIAL = Material(young=7.0e9, poisson=0.3, density=1000.0, damping=4000.0, damping_ratio=0.0)
"""Material of the body that is stepped with CMPM. Leapfrog needs steps of about 1e-4 s for this stiffness.
The material is damped, because CMPM without damping gains energy at any step length."""

BAR_CELLS = (20, 10, 5)  # 5,000 tetrahedra
BAR_MATERIAL = Material(young=1.0e6, poisson=0.3, density=1000.0, damping=20.0, damping_ratio=0.0)
STIFF_BAR_MATERIAL = Material(young=1.0e8, poisson=0.3, density=1000.0, damping=100.0, damping_ratio=0.0)
FRAME = 1 / 60
TOLERANCE = 1e-3


@dataclass(frozen=True)
class ImplicitGain:
    """Times to simulate one second with implicit Euler and with another method, from alternating runs."""

    name: str
    step: float  # step of implicit Euler [s]
    other_step: float  # step of the other method [s]
    implicit: Spread  # time of implicit Euler [ms per simulated second]
    other: Spread
    gain: Spread  # time of the other method divided by the time of implicit Euler, for each pair
    deviation: float | None  # largest difference of positions, relative to the body's size; None if unknown
    is_sound: bool  # True if the body was valid at the end


def measure_implicit(repeats: int = 5) -> list[ImplicitGain]:
    """Measure the speed-up in all three comparisons. Raises: OptionError if scipy is not installed."""
    few = max(3, repeats // 2)
    return [_cmpm_against_leapfrog(repeats), _bar_against_leapfrog(few), _bar_against_scipy(few)]


def _cmpm_against_leapfrog(repeats: int) -> ImplicitGain:
    mesh = sphere(1.0, 3)
    worlds = {}
    for integrator in ("leapfrog", "implicit_euler"):
        world = bare_world(integrator=integrator, tolerance=TOLERANCE)
        world.add_body(mesh, CMPM_MATERIAL, law="cmpm", position=(0.0, 0.0, 1.5))
        world.build()
        worlds[integrator] = world
    limit = worlds["leapfrog"].bodies[0].stable_step.limit
    substeps = int(1.0 / worlds["leapfrog"].bodies[0].stable_step.recommended)
    steps = max(1, int(1.0 / (GROWTH * limit)))
    share = 0.1  # simulated time of each measurement [s]
    explicit = partial(worlds["leapfrog"].step, share, max(1, int(share * substeps)))
    implicit = partial(worlds["implicit_euler"].step, share, max(1, int(share * steps)))
    one, other, ratio = compare(explicit, implicit, repeats, 1e3 / share)
    body = worlds["implicit_euler"].bodies[0]
    sound = not body.is_frozen and body.flipped_count() == 0
    return ImplicitGain(
        "cmpm sphere, against leapfrog",
        share / max(1, int(share * steps)),
        1.0 / substeps,
        other,
        one,
        ratio,
        None,
        sound,
    )


def _bar_against_leapfrog(repeats: int) -> ImplicitGain:
    """Measure the bar with the virial law. The thesis does not use its force gradients (section 6.5)."""
    mesh = box((4.0, 1.0, 1.0), BAR_CELLS)
    bent = mesh.vertices + [0.0, 0.0, 0.1] * np.sin(2.0 * mesh.vertices[:, :1])
    worlds = {}
    for integrator in ("leapfrog", "implicit_euler"):
        world = bare_world(floor=None, integrator=integrator, tolerance=TOLERANCE)
        body = world.add_body(mesh, STIFF_BAR_MATERIAL, law="virial")
        world.build()
        body.set_motion(bent, np.zeros_like(bent))
        worlds[integrator] = world
    explicit = partial(worlds["leapfrog"].step, FRAME)
    implicit = partial(worlds["implicit_euler"].step, FRAME)
    one, other, ratio = compare(explicit, implicit, repeats, 1e3 / FRAME)
    return ImplicitGain(
        f"bar of {len(mesh.tets):,} tetrahedra, 100 MPa, against leapfrog",
        FRAME,
        FRAME / worlds["leapfrog"].stable_substeps(FRAME),
        other,
        one,
        ratio,
        None,
        not worlds["implicit_euler"].bodies[0].is_frozen,
    )


def _bar_against_scipy(repeats: int) -> ImplicitGain:
    mesh = box((4.0, 1.0, 1.0), BAR_CELLS)
    world = bare_world(floor=None, integrator="implicit_euler", tolerance=TOLERANCE)
    body = world.add_body(mesh, BAR_MATERIAL, law="virial")
    world.build()
    native = SparseBody(mesh, BAR_MATERIAL)
    bent = mesh.vertices.copy()
    bent[:, 2] += 0.1 * np.sin(2.0 * bent[:, 0])  # makes the right-hand side of the solver nonzero
    body.set_motion(bent, np.zeros_like(bent))
    native.positions[:] = bent
    ours, theirs = partial(world.step, FRAME), partial(native.step, FRAME, TOLERANCE)
    other, one, ratio = compare(theirs, ours, repeats, 1e3 / FRAME)
    moved = np.abs(body.positions() - native.positions).max() / np.ptp(mesh.vertices)
    name = f"bar of {len(mesh.tets):,} tetrahedra, against scipy"
    return ImplicitGain(name, FRAME, FRAME, one, other, ratio, float(moved), not body.is_frozen)
