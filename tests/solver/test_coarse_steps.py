"""Steps that are too coarse are retried with smaller substeps in every world; the limit of substeps."""

import warnings

import numpy as np
import pytest

from taichi_soft import (
    Material,
    OptionError,
    SlowStepWarning,
    SpringMaterial,
    TetMesh,
    box,
    rope,
    sphere,
)
from taichi_soft.world.bare import bare_world

BALL = sphere(0.5, 3)
JELLY = Material(1e5, 0.3, 1000.0)


def left_by_a_coarse_step(retries, schedule, **options):
    """A body that shivers, after steps of a third of the substeps that it needs."""
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=retries, schedule=schedule)
    body = world.add_body(BALL, JELLY, **options)
    world.build()
    noise = 2.0 * np.random.default_rng(0).normal(size=BALL.vertices.shape)
    body.set_motion(BALL.vertices, noise + np.array([1.0, 2.0, 3.0]))
    before = body.momentum()
    dt = 60 * body.stable_step.limit
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(5):
            world.step(dt, 20)
    return world, body, before


@pytest.mark.parametrize("schedule", ["per_body", pytest.param("flat", marks=pytest.mark.soak)])
def test_a_step_too_coarse_is_made_again_finer_in_a_world_without_colliders(schedule):
    _world, body, momentum = left_by_a_coarse_step(3, schedule)
    assert not body.is_frozen
    assert body.kinetic_energy() < 0.5 * body.masses.sum() * (3 * 2.0**2 + 14)
    np.testing.assert_allclose(body.momentum(), momentum, rtol=1e-4)


@pytest.mark.parametrize("schedule", ["per_body", pytest.param("flat", marks=pytest.mark.soak)])
def test_without_retries_it_freezes_at_once(schedule):
    _world, body, _ = left_by_a_coarse_step(0, schedule)
    assert body.is_frozen
    assert body.failure.substep < 20


def test_a_step_that_no_fineness_mends_is_braked_and_keeps_momentum_and_spin():
    """The step is ten times too long even after one retry.

    Vibrations are removed, rigid motion is preserved.
    """
    mesh = sphere(0.5, 2)
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=1)
    body = world.add_body(mesh, JELLY)
    world.build()
    rng = np.random.default_rng(2)
    spin = np.cross((0.5, -1.0, 2.0), mesh.vertices)
    body.set_motion(
        mesh.vertices, 3.0 * rng.normal(size=mesh.vertices.shape) + spin + np.array([4.0, 0, 1.0])
    )
    momentum, spin = body.momentum(), body.angular_momentum()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(10):
            world.step(200 * body.stable_step.limit, 10)
    assert not body.is_frozen
    np.testing.assert_allclose(body.momentum(), momentum, rtol=1e-3)
    np.testing.assert_allclose(body.angular_momentum(), spin, rtol=0.02, atol=0.02 * np.linalg.norm(spin))


def with_sliver():
    """A box with one more tetrahedron on its side, a thousandth as thick."""
    base = box((1, 1, 1), (3, 3, 3))
    face = base.surface[0]
    corners = base.vertices[face]
    outward = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    tip = corners.mean(axis=0) + 1e-4 * outward / np.linalg.norm(outward)
    tet = [face[0], face[2], face[1], len(base.vertices)]
    return TetMesh(np.vstack([base.vertices, tip]), np.vstack([base.tets, tet]), fix_orientation=True)


def test_a_world_of_many_substeps_says_when_built_which_slivers_or_which_damping_ask_for_them():
    for mesh, material, named in (
        (with_sliver(), JELLY, "1 of .* slivers.*improved"),
        (BALL, Material(1e5, 0.3, 1000.0, 1e5), "damping_ratio instead"),
        (BALL.scaled(1e-3), Material(1e6, 0.3, 1000.0), "coarser mesh or a softer material"),
        (
            BALL,
            Material(np.where(np.arange(len(BALL.tets)) < 5, 1e11, 1e6), 0.3, 1000.0),
            "or a softer material",
        ),
    ):
        world = bare_world()
        world.add_body(mesh, material, position=(0, 0, 3))
        with pytest.warns(SlowStepWarning, match=named):
            world.build()


def test_a_world_that_may_not_take_so_many_refuses_and_stays_as_it_was():
    world = bare_world(max_substeps=3)
    world.add_body(BALL, Material(1e7, 0.3, 1000.0), position=(0, 0, 3))
    with pytest.raises(OptionError, match=r"substeps.*max_substeps=3"):
        world.build()
    assert not world.is_built
    small = bare_world(max_substeps=20)
    body = small.add_body(BALL, JELLY, position=(0, 0, 3))
    small.build()
    before = body.positions()
    for call in (lambda: small.step(1.0), lambda: small.step(1 / 60, 21)):
        with pytest.raises(OptionError, match="max_substeps=20"):
            call()
    assert small.step_count == 0
    np.testing.assert_array_equal(body.positions(), before)
    small.step(1 / 60)
    body.set_material(Material(1e8, 0.3, 1000.0))
    with pytest.raises(OptionError, match=r"elements.*max_substeps=20"):
        small.step(1 / 60)


@pytest.mark.soak
def test_what_one_may_ask_of_implicit_euler_is_bounded_too():
    world = bare_world(max_substeps=2, integrator="implicit_euler")
    world.add_body(rope(1.0, 8, 1.0), SpringMaterial(1e9), law="springs", position=(0, 0, 3))
    world.build()
    world.step(1 / 60)
    with pytest.raises(OptionError, match=r"substeps.*3.*max_substeps=2"):
        world.step(1 / 60, 3)


@pytest.mark.parametrize("value", [-1, 1.5, "many", 100])
def test_what_is_no_number_of_retries_is_refused(value):
    with pytest.raises(OptionError, match="retries"):
        bare_world(retries=value)
