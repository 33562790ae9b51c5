"""Grabs: they pull as their spring prescribes, and never tear the body."""

import numpy as np
import pytest

from taichi_soft import (
    Material,
    MeshError,
    OptionError,
    SoftBodyAsset,
    SpringMaterial,
    StateError,
    box,
    cloth,
    rope,
)
from taichi_soft.world.bare import bare_world

MESH = box(cells=(4, 4, 4))
MIDDLE = int(np.argmin(np.linalg.norm(MESH.vertices - [0, 0, 0.5], axis=1)))  # of the top face
TOP = int(np.flatnonzero((MESH.surface == MIDDLE).any(axis=1))[0])
AT_MIDDLE = (MESH.surface[TOP] == MIDDLE).astype(float)
KINDS = ("leapfrog", "implicit_euler")
NAN = float("nan")


@pytest.fixture(scope="module")
def made():
    """Per integrator a world with a soft cube and a stiffer one far away."""
    worlds = {}
    for kind in KINDS:
        world = bare_world(integrator=kind, floor=-1e3)  # far below; the floor lets all tests share kernels
        world.add_body(MESH, Material(1e5, 0.3, 1000.0, 20.0))
        world.add_body(MESH, Material(2e6, 0.3, 1000.0, 100.0), position=(0, 0, 50))
        world.build()
        worlds[kind] = world
    return worlds


def at_rest(world):
    for grab in list(world.grabs):
        grab.release()
    for i, body in enumerate(world.bodies):
        body.unpin()
        body.set_gravity_scale(0.0)
        body.set_linear_damping(0.0)
        body.set_motion(MESH.vertices + np.array([0, 0, 50.0 * i]), np.zeros((len(MESH.vertices), 3)))
    return world, *world.bodies


@pytest.fixture(params=["leapfrog", pytest.param("implicit_euler", marks=pytest.mark.soak)])
def floating(request, made):
    return at_rest(made[request.param])


@pytest.fixture
def plain(made):
    return at_rest(made["leapfrog"])


def held_point(body, barycentrics=(1 / 3, 1 / 3, 1 / 3)):
    return np.asarray(barycentrics) @ body.positions()[MESH.surface[TOP]].astype(float)


def largest_stretch(body):
    return np.linalg.norm(body.deformations(), ord=2, axis=(1, 2)).max()


def test_a_grab_starts_where_the_body_is_and_moves_nothing(floating):
    world, body, _ = floating
    before = body.positions()
    grab = body.grab(TOP, (0.2, 0.3, 0.5))
    np.testing.assert_allclose(grab.point, held_point(body, (0.2, 0.3, 0.5)), atol=1e-6)
    for _ in range(5):
        world.step(1 / 60)
    np.testing.assert_allclose(body.positions(), before, atol=1e-5)


@pytest.mark.parametrize("which", [0, 1])
def test_a_held_body_hangs_by_its_spring(floating, which):
    """It sags by g / omega^2 and pulls with its weight, whether the patch bears that alone or not."""
    world, *bodies = floating
    body = bodies[which]
    body.set_gravity_scale(1.0)
    body.set_linear_damping(3.0)
    grab = body.grab(TOP, AT_MIDDLE, frequency=2.0)
    for _ in range(240):
        world.step(1 / 60)
    sag = grab.point - held_point(body, AT_MIDDLE)
    assert sag[2] == pytest.approx(9.81 / (4 * np.pi) ** 2, rel=0.02)
    assert grab.force[2] == pytest.approx(9.81 * 1000, rel=0.01)
    assert largest_stretch(body) < 1.6
    assert not body.is_frozen


def test_a_body_follows_without_swing_as_a_critically_damped_oscillator(plain):
    """x = d (1 - (1 + w t) exp(-w t)) of a stiff body pulled through its middle."""
    world, _, body = plain
    grab = body.grab(TOP, AT_MIDDLE, frequency=1.0)
    start = body.center_of_mass()
    middle = grab.point + np.array([0, 0, 0.1])
    grab.move(middle)
    np.testing.assert_array_equal(grab.point, middle)
    path = []
    for _ in range(90):
        world.step(1 / 60)
        path.append(body.center_of_mass()[2] - start[2])
    wt = 2 * np.pi * np.arange(1, 91) / 60
    np.testing.assert_allclose(path, 0.1 * (1 - (1 + wt) * np.exp(-wt)), atol=6e-3)
    assert max(path) < 0.102


def test_the_pull_is_what_the_body_gets_and_no_more_than_allowed(plain):
    world, body, other = plain
    grab = other.grab(TOP, max_force=500.0)
    grab.move((3.0, 0.0, 52.0))
    before = other.momentum()
    world.step(1e-3, 1)
    np.testing.assert_allclose(other.momentum() - before, grab.force * 1e-3, atol=1e-4)
    assert np.linalg.norm(grab.force) == pytest.approx(500.0, rel=1e-3)
    assert not body.momentum().any()
    grab.release()
    before = other.momentum()
    for _ in range(3):
        world.step(1 / 60)
    np.testing.assert_allclose(other.momentum(), before, atol=2e-3)


@pytest.mark.parametrize("frequency", [0.5, 5.0, 1000.0])
@pytest.mark.parametrize("which", [0, 1])
def test_no_pull_tears_the_body(floating, frequency, which):
    """A target 11 km away, no limit to the force, the longest stable substeps; let go in the middle."""
    world, *bodies = floating
    body = bodies[which]
    body.set_gravity_scale(1.0)
    grab = body.grab(TOP, frequency=frequency, max_force=1e19 if frequency > 100 else None)
    for target in ((1e4, 2e3, 5e3), (-1e4, 0, 0)):
        grab.move(target)
        for _ in range(20):
            world.step(1 / 60)
            assert largest_stretch(body) < 2.0
            assert np.linalg.norm(body.momentum()) < 1.2 * 50 * 1000
    assert not body.is_frozen
    assert body.momentum()[0] != 0
    grab.release()
    for _ in range(120):
        world.step(1 / 60)
    np.testing.assert_allclose(
        np.linalg.svd(body.deformations(), compute_uv=False), 1.0, atol=0.05 if which == 0 else 0.02
    )


def test_two_hands_stretch_a_body(plain):
    world, body, _ = plain
    left, right = (int(np.argmax(MESH.vertices[MESH.surface].mean(axis=1)[:, 0] * side)) for side in (-1, 1))
    grabs = [body.grab(left), body.grab(right)]
    for grab, side in zip(grabs, (-1, 1), strict=True):
        grab.move(grab.point + np.array([0.3 * side, 0, 0]))
    for _ in range(90):
        world.step(1 / 60)
    assert np.ptp(body.positions()[:, 0]) > 1.05
    assert grabs[0].force[0] == pytest.approx(-grabs[1].force[0], rel=0.05)
    assert grabs[1].force[0] > 100
    grabs[0].release()
    assert grabs[1].is_held
    for _ in range(120):
        world.step(1 / 60)
    np.testing.assert_allclose(grabs[1].point, held_of(body, right), atol=0.02)


def held_of(body, triangle):
    return body.positions()[MESH.surface[triangle]].mean(axis=0)


def test_a_world_has_sixteen_hands(plain):
    world, body, other = plain
    grabs = [(body, other)[i % 2].grab(i) for i in range(16)]
    before = [b.positions().tobytes() for b in world.bodies]
    with pytest.raises(StateError, match="16 grabs"):
        body.grab(20)
    assert [b.positions().tobytes() for b in world.bodies] == before
    grabs[5].release()
    assert body.grab(20).is_held
    for _ in range(3):
        world.step(1 / 60)
    assert not body.is_frozen


@pytest.mark.soak
def test_cloth_is_held_by_its_springs(made):
    world = bare_world(floor=None)
    mesh = cloth((1.0, 1.0), (8, 8), 0.5)
    body = world.add_body(mesh, SpringMaterial(300.0, 0.05), law="springs")
    world.build()
    grab = body.grab(0)
    grab.move((1e4, 0, 0))
    for _ in range(10):
        world.step(1 / 60)
    grab.move((0.0, 0, 0.5))
    for _ in range(120):
        world.step(1 / 60)
    assert not body.is_frozen
    held = body.positions()[mesh.surface[0]].mean(axis=0)
    assert np.linalg.norm(held - [0, 0, 0.5]) < 0.15


BAD_CALLS = {
    "triangle too high": lambda b, g: b.grab(len(MESH.surface)),
    "triangle below zero": lambda b, g: b.grab(-1),
    "triangle 1.0": lambda b, g: b.grab(1.0),
    "barycentrics of another sum": lambda b, g: b.grab(0, (1, 1, 1)),
    "barycentrics outside": lambda b, g: b.grab(0, (1.5, -0.5, 0)),
    "barycentrics NaN": lambda b, g: b.grab(0, (NAN, 0, 1)),
    "frequency zero": lambda b, g: b.grab(0, frequency=0),
    "frequency NaN": lambda b, g: b.grab(0, frequency=NAN),
    "force negative": lambda b, g: b.grab(0, max_force=-1.0),
    "move to NaN": lambda b, g: g.move((0, 0, NAN)),
    "move to a number": lambda b, g: g.move(3.0),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_a_refused_call_changes_nothing(plain, name):
    world, body, other = plain
    grab = other.grab(TOP)
    before = [b.positions().tobytes() for b in world.bodies], grab.point.tolist(), len(world.grabs)
    with pytest.raises(OptionError):
        BAD_CALLS[name](body, grab)
    world.step(1 / 60)
    now = [b.positions().tobytes() for b in world.bodies], grab.point.tolist(), len(world.grabs)
    assert now[1:] == before[1:]
    assert body.positions().tobytes() == before[0][0]


def test_a_ray_grabs_only_what_it_may(plain):
    world, body, other = plain
    down = ((0.3, 0.3, 60.0), (0, 0, -1))
    assert world.grab(*down, bodies=[]) is None
    assert world.grab(*down, bodies=iter([body])).body is body
    assert world.grab(*down).body is other


def test_a_released_grab_is_spent(plain):
    _, body, _ = plain
    grab = body.grab(TOP)
    grab.release()
    other = body.grab(TOP)
    for use in (grab.release, lambda: grab.move((0, 0, 0)), lambda: grab.force):
        with pytest.raises(StateError, match="was released"):
            use()
    assert other.is_held
    assert not grab.is_held


def test_a_grab_of_a_body_that_went_holds_nothing(cube, jelly):
    world = bare_world(floor=None)
    asset = SoftBodyAsset(cube, jelly)
    world.reserve(asset, 1)
    world.build()
    body = world.spawn(asset)
    hand = body.grab(0)
    world.despawn(body)
    assert not hand.is_held
    assert repr(hand) == "Grab(body 0, released)"
    with pytest.raises(StateError, match="released"):
        hand.move((0, 0, 0))


def test_what_cannot_be_grabbed_says_so(cube, jelly):
    world = bare_world(floor=None)
    line = world.add_body(rope(1.0, 5, 0.1), SpringMaterial(100.0, 0.1), law="springs")
    body = world.add_body(cube, jelly)
    with pytest.raises(StateError, match="not built"):
        body.grab(0)
    with pytest.raises(MeshError, match="no surface"):
        line.grab(0)
    flat = bare_world(schedule="flat", floor=None)
    body = flat.add_body(cube, jelly)
    flat.build()
    with pytest.raises(StateError, match="schedule='per_body'"):
        body.grab(0)
