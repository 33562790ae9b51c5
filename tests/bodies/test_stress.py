"""The stress of each law, compared with closed forms and, by the virial theorem, with forces."""

from typing import NamedTuple

import numpy as np
import pytest

from taichi_soft import (
    AnisotropicMaterial,
    Material,
    OptionError,
    Stiffness,
    StressExceeded,
    TearCandidates,
    box,
    internal_forces,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

DT = 1 / 60
MESH = box((1, 1, 1), cells=(1, 1, 1))
YOUNG, NU = 1e5, 0.3
MU, LAM = YOUNG / (2 * (1 + NU)), YOUNG * NU / ((1 + NU) * (1 - 2 * NU))
RUBBER = Material(YOUNG, NU, 1000.0)
GRAIN = Stiffness.orthotropic(young=(4e5, 1e5, 5e4), poisson=(0.2, 0.1, 0.3), shear=(6e4, 5e4, 2e4))
WOOD = AnisotropicMaterial(GRAIN, 1000.0)
STRETCHES = (1.3, 0.8)
I3 = np.eye(3)


def hooke(material, strain):
    """Return the stress of a strain along x only [Pa]."""
    if material is RUBBER:
        return np.diag([LAM + 2 * MU, LAM, LAM]) * strain
    return np.diag(GRAIN.matrix[:3, 0]) * strain


def linear(material, s):
    return hooke(material, (s**2 - 1) / 2)


def exact(material, s):
    return hooke(material, s - 1)


def st_venant_kirchhoff(material, s):
    """1/J F S F^T with S = Hooke's stress of Green's strain, and J = s."""
    return np.diag([s, 1, 1]) @ linear(material, s) @ np.diag([s, 1, 1]) / s


def neo_hookean(_, s):
    """1/J dpsi/dF F^T of psi = m/2 (I - 3) + l/2 (J - a)^2 - m/2 log(I + 1), with I = s^2 + 2 and J = s."""
    m, l = 4 / 3 * MU, LAM + 5 / 6 * MU  # noqa: E741
    along = m * (1 - 1 / (s**2 + 3))
    return along * np.diag([s, 1 / s, 1 / s]) + l * (s - 1 - MU / l) * I3


class Case(NamedTuple):
    """A law, and its stress in closed form."""

    oracle: object  # (material, stretch along x) -> (3, 3) [Pa]
    material: object
    options: dict


CASES = {
    "virial": Case(linear, RUBBER, {"law": "virial"}),
    "virial, exact": Case(exact, RUBBER, {"law": "virial", "strain": "exact"}),
    "virial, wood": Case(linear, WOOD, {"law": "virial"}),
    "virial, wood, exact": Case(exact, WOOD, {"law": "virial", "strain": "exact"}),
    "face": Case(linear, RUBBER, {"law": "face"}),
    "face, wood, exact": Case(exact, WOOD, {"law": "face", "strain": "exact"}),
    "st_venant_kirchhoff": Case(st_venant_kirchhoff, RUBBER, {"law": "st_venant_kirchhoff"}),
    "st_venant_kirchhoff, wood": Case(st_venant_kirchhoff, WOOD, {"law": "st_venant_kirchhoff"}),
    "neo_hookean": Case(neo_hookean, RUBBER, {"law": "neo_hookean"}),
    "volume_springs": Case(linear, RUBBER, {"law": "volume_springs"}),
}


def von_mises(stress):
    deviator = stress - np.trace(stress) / 3 * I3
    return np.sqrt(1.5 * np.sum(deviator**2))


@pytest.fixture(scope="module")
def still():
    """Return a world with a box for every case. All vertices are pinned."""
    world = bare_world(gravity=(0, 0, 0), floor=None)
    for k, case in enumerate(CASES.values()):
        world.add_body(MESH, case.material, pinned=range(8), position=(0, 3 * k, 0), **case.options)
    world.build()
    world.record_events()
    return world


def deform(world, name, F):
    """Deform the body of a case, restore all other bodies, and return it."""
    world.drain_events()
    for body in world.bodies:
        body.watch_stress(None)
        body.watch_tearing(None)
        body.set_motion(MESH.vertices, np.zeros((8, 3)))
    body = world.bodies[list(CASES).index(name)]
    body.set_motion(MESH.vertices @ np.asarray(F).T, np.zeros((8, 3)))
    return body


def look(world):
    """Return the events of a step in which nothing moves.

    With so many laws, the kernel of a real step would take minutes to compile.
    """
    world._context.built.events.collect(world.step_count, world.time, DT)
    return world.drain_events()


@pytest.mark.parametrize("s", STRETCHES)
@pytest.mark.parametrize("name", CASES)
def test_stress_of_a_stretch_along_one_axis_is_that_of_the_law(name, s, still, turned):
    case = CASES[name]
    wanted = case.oracle(case.material, s)
    body = deform(still, name, turned @ np.diag([s, 1, 1]))
    count = len(MESH.tets)
    np.testing.assert_allclose(body.tet_stress(), np.full(count, von_mises(wanted)), rtol=2e-5)
    np.testing.assert_allclose(body.vertex_stress(), np.full(8, von_mises(wanted)), rtol=2e-5)
    in_world = np.tile(turned @ wanted @ turned.T, (count, 1, 1))
    np.testing.assert_allclose(body.stresses(), in_world, atol=2e-6 * YOUNG)


@pytest.mark.parametrize("s", STRETCHES)
@pytest.mark.parametrize("name", CASES)
def test_a_watch_fires_just_below_the_stress_of_the_law_and_not_above_it(name, s, still, turned):
    case = CASES[name]
    wanted = case.oracle(case.material, s)
    mises, pull = von_mises(wanted), np.linalg.eigvalsh(wanted)[-1]
    body = deform(still, name, turned @ np.diag([s, 1, 1]))
    kinds = [StressExceeded, TearCandidates] if pull > 0 else [StressExceeded]
    for part, told in ((1.001, []), (0.999, kinds)):
        body.watch_stress(part * mises)
        body.watch_tearing(part * pull if pull > 0 else 1.0)
        events = look(still)
        assert [type(event) for event in events] == told
    assert all(event.body is body and len(event.tetrahedra) == len(MESH.tets) for event in events)
    np.testing.assert_allclose(events[0].stress, mises, rtol=1e-4)
    if pull > 0:
        np.testing.assert_allclose(events[1].stress, pull, rtol=1e-4)
        np.testing.assert_allclose(np.abs(events[1].normals @ turned[:, 0]), 1.0, atol=1e-5)


SHEARED = {
    "pulled two ways": [[1.3, 0.1, 0.0], [0.0, 1.25, -0.1], [0.0, 0.0, 0.9]],
    "pulled and sheared": [[1.2, 0.3, 0.1], [0.0, 1.0, 0.2], [0.1, 0.0, 0.9]],
    "pressed one way": [[1.1, 0.0, 0.1], [0.1, 1.1, 0.0], [0.0, 0.0, 0.7]],
}


@pytest.mark.parametrize("F", SHEARED.values(), ids=SHEARED)
def test_a_watch_for_tearing_finds_the_largest_principal_stress_of_any_stress(F, still):
    """The direction of this stress is also checked. The reference is the matrix from `stresses`, by NumPy."""
    body = deform(still, "virial", F)
    pulls, axes = np.linalg.eigh(body.stresses()[0])
    assert pulls[2] > 0
    for part, count in ((1.001, 0), (0.999, 1)):
        body.watch_tearing(part * pulls[2])
        events = look(still)
        assert len(events) == count
    np.testing.assert_allclose(events[0].stress, pulls[2], rtol=1e-4)
    np.testing.assert_allclose(np.abs(events[0].normals @ axes[:, 2]), 1.0, atol=1e-5)


@pytest.mark.parametrize("name", CASES)
def test_the_force_across_a_plane_is_the_stress_on_its_section(name, still, turned):
    """The force is sigma n A. The cube is deformed uniformly, so its section is a square deformed by F."""
    F = turned @ np.array([[1.2, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.9]])
    body = deform(still, name, F)
    stress, middle = body.stresses()[0], F @ MESH.vertices.mean(axis=0)
    for axis in range(3):
        area = np.linalg.det(F) * np.linalg.inv(F).T @ I3[axis]  # Nanson's formula for the section of 1 m^2
        found = body.force_across(middle, 3 * area)
        np.testing.assert_allclose(found, stress @ area, atol=5e-6 * YOUNG)
        np.testing.assert_allclose(body.force_across(middle, -area), -found, atol=1e-6 * YOUNG)
    assert body.force_across(middle + 9, (0, 0, 1)).tolist() == [0, 0, 0]
    with pytest.raises(OptionError, match="normal is zero"):
        body.force_across(middle, (0, 0, 0))
    with pytest.raises(OptionError, match="point"):
        body.force_across((0, 0), (0, 0, 1))


@pytest.mark.guard
@pytest.mark.parametrize("mirror", [1.0, -1.0])
@pytest.mark.parametrize("name", [name for name in CASES if name != "volume_springs"])
def test_stress_is_that_of_the_forces(name, mirror, still, turned):
    """Compare the stress with the forces by the virial theorem (thesis eq. 6.16).

    The tetrahedra of a body are all deformed alike. For inverted tetrahedra, the volume is that of the mirror
    image, or negative if the law restores the orientation.
    """
    case, F = CASES[name], turned @ np.array([[1.2, 0.3, 0.0], [0.1, 0.8, -0.2], [0.0, 0.2, mirror]])
    body = deform(still, name, F)
    x = body.positions().astype(np.float64)
    forces = internal_forces(MESH, case.material, x, **case.options)
    volume = np.linalg.det(F) if name == "neo_hookean" else abs(np.linalg.det(F))
    expected = np.tile(-forces.T @ x / volume, (len(MESH.tets), 1, 1))
    np.testing.assert_allclose(body.stresses(), expected, atol=2e-6 * 4e5)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(
    "F", [np.diag([1.0, 1, 0]), np.diag([2.0, 0, 0]), np.zeros((3, 3)), -I3, np.diag([1, 1, -1e-7])]
)
def test_flat_and_inside_out_the_stress_is_finite(name, F, still):
    body = deform(still, name, F)
    body.watch_stress(1.0)
    body.watch_tearing(1.0)
    told = [event.stress for event in look(still)]
    assert np.isfinite(body.tet_stress()).all()
    assert all(np.isfinite(stress).all() for stress in told)
