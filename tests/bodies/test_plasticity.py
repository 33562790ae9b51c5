"""Permanent change of the rest shape: yield, creep, largest change, and reset of a pool's slot."""

import functools
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from taichi_soft import (
    AnisotropicMaterial,
    Material,
    MaterialError,
    OptionError,
    Plasticity,
    SoftBodyAsset,
    Stiffness,
    box,
)
from taichi_soft.bodies.kernels.plasticity import read_rest_inverses
from taichi_soft.bodies.soft_body import rest_inverses_of
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

YOUNG, POISSON = 1e5, 0.3
SHEAR = YOUNG / (2 * (1 + POISSON))
CLAY = Material(YOUNG, POISSON, 1000.0, 20.0)
MESH = box(cells=(2, 2, 2))
EVERY = np.arange(len(MESH.vertices))
DT = 1 / 60

MODES = {
    "per_body": {"schedule": "per_body"},
    "flat": {"schedule": "flat"},
    "implicit": {"integrator": "implicit_euler"},
    "colliders": {"collider_room": 1},
}


def equivalent(values):
    """Return sqrt(2/3 e:e) of the deviator e of principal values."""
    deviator = values - values.mean()
    return np.sqrt(2 / 3 * deviator @ deviator)


def yielded(stretches, limit):
    """Compute the elastic stretches after return mapping, in closed form.

    The volume and the direction of the deviator of the logarithmic strain are preserved. The equivalent
    linear strain is at the limit.
    """
    logarithms = np.log(stretches)
    mean, deviator = logarithms.mean(), logarithms - logarithms.mean()

    def beyond(kept):
        return equivalent(0.5 * (np.exp(2 * (mean + kept * deviator)) - 1)) - limit

    if beyond(1.0) <= 0:
        return stretches
    return np.exp(mean + brentq(beyond, 0.0, 1.0, xtol=1e-14) * deviator)


KINDS = {
    "plain": {"plasticity": Plasticity(yield_strain=0.1)},
    "stress": {"plasticity": Plasticity(yield_stress=3 * SHEAR * 0.1)},
    "slow": {"plasticity": Plasticity(yield_strain=0.01, creep=2.0)},
    "limited": {"plasticity": Plasticity(yield_strain=0.02, maximum=0.3)},
    "virial": {"plasticity": Plasticity(yield_strain=0.05, creep=20.0)},
    "neo_hookean": {"plasticity": Plasticity(yield_strain=0.05, creep=20.0), "law": "neo_hookean"},
    "st_venant_kirchhoff": {
        "plasticity": Plasticity(yield_strain=0.05, creep=20.0),
        "law": "st_venant_kirchhoff",
    },
    "elastic": {},
}


def make_world(mode, *kinds):
    """Make a world with one body of each kind.

    Every vertex is pinned, so that `deform` determines the deformation.
    """
    world = bare_world(floor=None, gravity=(0, 0, 0), **MODES[mode])
    for kind in kinds:
        world.add_body(MESH, CLAY, pinned=EVERY, **KINDS[kind])
    world.build()
    return world


@pytest.fixture(scope="module")
def fresh():
    """Return a function that makes a new body of a kind, in a slot that other bodies used before."""
    world = make_world("per_body", *KINDS)

    def make(kind):
        world.despawn(world.bodies[list(KINDS).index(kind)])
        return world.spawn(world._context.slots.assets[list(KINDS).index(kind)])

    make.world = world
    return make


@pytest.fixture(scope="module")
def worlds():
    """Return a function that returns the world of a mode. A world is made at its first use."""
    return functools.cache(lambda mode: make_world(mode, "stress"))


def deform(body, F, steps=1, dt=DT):
    body.set_motion(MESH.vertices @ np.asarray(F, dtype=float).T, np.zeros_like(MESH.vertices))
    for _ in range(steps):
        body._context.built.step(dt, 1, dt)


@pytest.mark.guard
def test_below_yield_nothing_changes_to_the_bit(fresh):
    body = fresh("plain")
    before = rest_inverses_of(body)
    s = 1.09  # uniaxial at constant volume: strain (s^2 - 1/s) / 3
    assert (s**2 - 1 / s) / 3 < 0.1
    deform(body, np.diag([s, s**-0.5, s**-0.5]), steps=3)
    deform(body, 2.0 * np.eye(3), steps=3)  # a change of volume alone never yields
    np.testing.assert_array_equal(rest_inverses_of(body), before)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("stretches", [(1.5, 0.8, 0.9), (2.2, 0.5, 1.0), (1.25, 1.2, 1.0)])
def test_beyond_yield_the_elastic_strain_is_that_of_return_mapping(mode, stretches, worlds):
    world = worlds(mode)
    world.despawn(world.bodies[0])
    body = world.spawn(world._context.slots.assets[0])
    deform(body, np.diag(stretches))
    elastic = yielded(np.array(stretches), 0.1)
    np.testing.assert_allclose(body.deformations(), np.tile(np.diag(elastic), (40, 1, 1)), atol=3e-6)
    np.testing.assert_allclose(body.tet_strain(), 0.1, rtol=1e-4)
    np.testing.assert_allclose(
        body.plastic_strains(), equivalent(np.log(np.array(stretches) / elastic)), rtol=1e-4
    )
    np.testing.assert_allclose(np.linalg.det(rest_inverses_of(body)) * MESH.volumes * 6, 1.0, rtol=1e-5)


def test_it_does_not_matter_how_the_body_is_turned(fresh, turned):
    F = np.array([[1.4, 0.5, 0.0], [0.1, 0.8, -0.2], [0.0, 0.3, 1.0]])
    body = fresh("plain")
    deform(body, F)
    shape = rest_inverses_of(body)
    body = fresh("plain")
    deform(body, turned @ F)
    np.testing.assert_allclose(rest_inverses_of(body), shape, atol=2e-5 * np.abs(shape).max())
    assert body.plastic_strains().min() > 0.1


def test_creep_takes_the_excess_away_at_its_rate(fresh):
    """After 1 / creep, a fraction 1 / e of the excess is left, for any step length."""
    F = np.diag([1.1, 1.1**-0.5, 1.1**-0.5])
    lasting = np.log(1.1) - np.log(yielded(np.diag(F), 0.01)[0])
    for dt, steps in ((0.01, 50), (0.02, 25)):
        body = fresh("slow")
        deform(body, F, steps, dt)
        np.testing.assert_allclose(body.plastic_strains(), lasting * (1 - math.exp(-1)), rtol=0.02)


def test_the_maximum_is_never_passed_and_can_be_left_again(fresh):
    body = fresh("limited")
    pull = np.diag([2.0, 2**-0.5, 2**-0.5])
    deform(body, pull, steps=5)
    np.testing.assert_allclose(body.plastic_strains(), 0.3, rtol=1e-4)
    deform(body, np.array([[2.0, 1.5, 0], [0, 0.5, 0], [0, 0, 1.0]]), steps=20)
    np.testing.assert_allclose(body.plastic_strains(), 0.3, rtol=1e-4)
    deform(body, np.eye(3), steps=20)
    assert body.plastic_strains().max() < 0.021


@pytest.mark.parametrize("law", ["virial", "neo_hookean", "st_venant_kirchhoff"])
def test_flow_only_takes_elastic_energy_away(fresh, law):
    body = fresh(law)
    rng = np.random.default_rng(1)
    for _ in range(10):
        deform(body, np.eye(3) + 0.2 * rng.normal(size=(3, 3)), steps=0)
        energies = [body.elastic_energy()]
        for _ in range(4):
            fresh.world.step(DT, 1)
            energies.append(body.elastic_energy())
        assert (np.diff(energies) <= 1e-6 * energies[0]).all()
        assert energies[-1] < 0.9 * energies[0]


@pytest.mark.guard
def test_a_bar_that_was_pulled_stays_as_long_as_return_mapping_says():
    """The bar is stretched at once and released.

    Its damped vibration ends at a length that the yield strain determines.
    """
    mesh = box((1.0, 0.2, 0.2), (10, 2, 2))
    world = bare_world(floor=None, gravity=(0, 0, 0))
    material = Material(YOUNG, POISSON, 1000.0, 60.0)
    body = world.add_body(mesh, material, plasticity=Plasticity(yield_strain=0.05))
    world.build()
    F = np.array([1.3, 1.3**-0.5, 1.3**-0.5])
    body.set_motion(mesh.vertices * F, np.zeros_like(mesh.vertices))
    world.step(1e-5, 1)
    for _ in range(600):
        world.step(DT)
    length = np.ptp(body.positions()[:, 0])
    assert length == pytest.approx(1.3 / yielded(F, 0.05)[0], rel=2e-3)
    assert length > 1.2
    assert body.volume() == pytest.approx(mesh.volume, rel=1e-3)


def test_a_body_from_a_pool_has_its_first_shape(fresh):
    body = fresh("plain")
    first = rest_inverses_of(body)
    deform(body, np.diag([2.0, 0.7, 0.7]))
    assert body.plastic_strains().min() > 0.1
    body = fresh("plain")
    np.testing.assert_array_equal(rest_inverses_of(body), first)
    assert body.plastic_strains().max() < 1e-6


def test_others_in_the_same_world_do_not_flow(fresh):
    rigid = fresh("elastic")
    deform(rigid, np.diag([2.0, 0.7, 0.7]))
    rows = np.empty((40, 3, 3), dtype=np.float32)
    read_rest_inverses(fresh.world._built.state, rigid.index, rows)
    np.testing.assert_allclose(rows, rigid.asset.arrays.rest_inverse, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"yield_stress.*yield_strain: got"),
        ({"yield_stress": 1.0, "yield_strain": 1.0}, r"yield_stress.*yield_strain: got"),
        ({"yield_stress": 0.0}, "yield_stress.*above 0 Pa"),
        ({"yield_strain": -1.0}, "yield_strain"),
        ({"yield_strain": math.nan}, "yield_strain"),
        ({"yield_strain": 0.1, "creep": 0.0}, "creep"),
        ({"yield_strain": 0.1, "maximum": -0.1}, "maximum"),
        ({"yield_strain": 0.1, "maximum": math.inf}, "maximum"),
    ],
)
def test_bad_numbers_are_refused(options, message):
    with pytest.raises(OptionError, match=message):
        Plasticity(**options)


def test_bodies_that_cannot_flow_are_refused():
    clay = Plasticity(yield_strain=0.1)
    with pytest.raises(OptionError, match=r"law 'springs' .* plasticity.*'virial'"):
        SoftBodyAsset(MESH, CLAY, law="springs", plasticity=clay)
    with pytest.raises(OptionError, match=r"Plasticity.*None"):
        SoftBodyAsset(MESH, CLAY, plasticity=0.1)
    wood = AnisotropicMaterial(Stiffness.isotropic(1e5, 0.3), 1000.0)
    with pytest.raises(MaterialError, match=r"AnisotropicMaterial .* plasticity"):
        SoftBodyAsset(MESH, wood, plasticity=clay)
