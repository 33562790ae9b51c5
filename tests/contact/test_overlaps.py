"""Bodies that start inside each other are separated slowly, and come to rest side by side."""

import numpy as np
import pytest

from taichi_soft import (
    Contact,
    Material,
    OptionError,
    SoftBodyAsset,
    SpringMaterial,
    box,
    cloth,
    sphere,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60
SOFT = Material(young=1e5, poisson=0.4, density=800.0)
CUBE = box((0.4,) * 3, (4, 4, 4))
SMALL = box((0.1,) * 3, (2, 2, 2))
SPEED = 2.0
"""Sizes per second at which bodies may part."""


def share_inside(body, other):
    """Share of a body's vertices and middles of tetrahedra that lie in a tetrahedron of another.

    Barycentric coordinates in float64, of places moved by 0.1 mm, so that none lies between two tetrahedra.
    """
    x = body.positions().astype(np.float64) + np.array([3e-5, 5e-5, 7e-5])
    points = np.concatenate([x, x[body.tets].mean(axis=1)]) if len(body.tets) else x
    corners = other.positions().astype(np.float64)[other.tets]
    inverse = np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
    rest = np.einsum("mab,mnb->mna", inverse, points[None] - corners[:, :1])
    shares = np.concatenate([1.0 - rest.sum(axis=2, keepdims=True), rest], axis=2)
    return (shares > 0.0).all(axis=2).any(axis=0).mean()


def overlap(body, other):
    return max(share_inside(body, other), share_inside(other, body) if len(body.tets) else 0.0)


def free_world(**options):
    return bare_world(**{"floor": None, "gravity": (0, 0, 0), "soft_contact": True, **options})


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def energy(body):
    return body.kinetic_energy() + body.elastic_energy()


TURN = (0.18, -0.31, 0.22, 0.907)
CASES = {
    "partly": (CUBE, (0.36, 0, 0), None),
    "nearly all": (CUBE, (0.05, 0.02, -0.03), None),
    "at one place": (CUBE, (0, 0, 0), None),
    "turned": (CUBE, (0.1, 0.2, 0.15), TURN),
    "a corner": (CUBE, (0.28, 0.29, 0.3), TURN),
    "one inside": (SMALL, (0.05, 0, 0), None),
    "in the middle": (SMALL, (0, 0, 0), None),
}


@pytest.mark.parametrize("integrator", ["leapfrog", pytest.param("implicit_euler", marks=pytest.mark.soak)])
def test_two_bodies_that_start_inside_each_other_come_apart_without_being_thrown(integrator):
    """Each pair is separated no faster than the limit, and comes to rest. Its centre of mass does not move.

    If the bodies are then thrown apart, they fly freely.
    """
    world = free_world(integrator=integrator)
    for row, (mesh, position, rotation) in enumerate(CASES.values()):
        world.add_body(CUBE, SOFT, position=(0, 2 * row, 0))
        world.add_body(mesh, SOFT, position=np.add(position, (0, 2 * row, 0)), rotation=rotation)
    world.build()
    pairs = list(zip(world.bodies[::2], world.bodies[1::2], strict=True))
    for name, pair in zip(CASES, pairs, strict=True):
        assert overlap(*pair) > 0.0, name

    def places():
        return np.array([[body.center_of_mass() for body in pair] for pair in pairs])

    paths = [places()]
    for _ in range(180):
        world.step(DT)
        paths.append(places())
    ways, apart = np.diff(paths, axis=0), []
    for row, (name, pair) in enumerate(zip(CASES, pairs, strict=True)):
        assert overlap(*pair) == 0.0, name
        size = min(np.ptp(body.mesh.vertices, axis=0).max() for body in pair)
        fastest = np.linalg.norm(ways[:, row, 1] - ways[:, row, 0], axis=1).max()
        assert fastest < 1.01 * SPEED * size * DT, name
        masses = np.array([body.masses.sum() for body in pair])
        assert np.abs(masses @ ways[:, row].sum(axis=0)).max() < 1e-4 * masses.sum(), name
        for body in pair:
            assert energy(body) < 5e-4 * body.masses.sum(), name  # as of 3 cm/s
            assert np.abs(body.velocities()).max() < 0.05, name
        axis = np.subtract(*places()[row])
        apart.append(np.linalg.norm(axis))
        for sign, body in zip((0.5, -0.5), pair, strict=True):
            body.set_velocity(sign * axis / apart[-1])
    run(world, 1.0)
    now = np.linalg.norm(places()[:, 0] - places()[:, 1], axis=1)
    np.testing.assert_allclose(now, np.add(apart, 1.0), atol=0.02)


@pytest.mark.guard
@pytest.mark.soak
def test_30_bodies_spawned_at_one_place_over_a_floor_come_to_rest_beside_and_on_each_other():
    world = bare_world(soft_contact=True, sleep_speed=0.02)
    ball = SoftBodyAsset(sphere(0.2, 2), Material(3e5, 0.3, 800.0, damping_ratio=0.3))
    world.reserve(ball, 30)
    world.build()
    bodies = [world.spawn(ball, position=(0, 0, 0.25)) for _ in range(30)]
    lowest, fastest = 0.0, 0.0
    for _ in range(400):
        world.step(DT)
        lowest = min(lowest, *(body.positions()[:, 2].min() for body in bodies))
        fastest = max(fastest, *(np.abs(body.velocities()).max() for body in bodies))
    for i, body in enumerate(bodies):
        assert all(share_inside(body, other) == 0.0 for other in bodies[:i] + bodies[i + 1 :])
    assert lowest > -1e-3
    assert fastest < 3.0  # as from a fall of 0.46 m
    assert not any(body.is_frozen for body in bodies)


def test_a_body_that_is_moved_into_others_leaves_them_and_no_other_does():
    """Overlaps by teleport and by set_motion are resolved. A pinned body stays in place.

    Bodies that filters or joints allow to overlap continue to overlap. Bodies that only touch do not move.
    """
    world = free_world()
    apart = Contact(group=2, mask=2)
    still, wall = (
        world.add_body(CUBE, SOFT),
        world.add_body(CUBE, SOFT, position=(0, 3, 0), pinned=range(125)),
    )
    world.add_body(CUBE, SOFT, position=(3, 3, 0), contact=apart)
    world.add_body(CUBE, SOFT, position=(3.1, 3, 0))
    tied = world.add_body(CUBE, SOFT, position=(3, 6, 0)), world.add_body(CUBE, SOFT, position=(3.3, 6, 0))
    for place in ((6, 0, 0), (6, 0.4, 0)):  # these positions only touch
        world.add_body(CUBE, SOFT, position=place)
    thrown, moved = (
        world.add_body(SMALL, SOFT, position=(0, -2, 0)),
        world.add_body(SMALL, SOFT, position=(0, -4, 0)),
    )
    world.build()
    tied[0].attach_to(tied[1], np.flatnonzero(CUBE.vertices[:, 0] > 0.19))
    start = [body.center_of_mass() for body in world.bodies]
    world.step(DT)
    for body, place in zip(world.bodies, start, strict=True):
        assert np.linalg.norm(body.center_of_mass() - place) < 1e-3  # contact gives them room
    before = {body: body.positions() for body in world.bodies}
    thrown.teleport((0.1, 0, 0))
    moved.set_motion(np.add(SMALL.vertices, (0.1, 3, 0)), np.zeros_like(SMALL.vertices))
    assert overlap(thrown, still) > 0.0
    assert overlap(moved, wall) > 0.0
    run(world, 4.0)
    assert overlap(thrown, still) == overlap(moved, wall) == 0.0
    np.testing.assert_array_equal(wall.positions(), before[wall])
    for body in world.bodies[2:6]:
        assert np.abs(body.positions() - before[body]).max() < 1.5e-3


def test_a_cloth_leaves_the_body_that_it_starts_in():
    world = free_world()
    block = world.add_body(CUBE, SOFT)
    sheet = world.add_body(
        cloth((0.3, 0.3), (6, 6), 0.1), SpringMaterial(50.0, 0.5), position=(-0.1, -0.1, 0.1)
    )
    world.build()
    assert share_inside(sheet, block) > 0.5
    run(world, 3.0)
    assert share_inside(sheet, block) == 0.0
    assert np.abs(sheet.velocities()).max() < 0.05


def test_a_world_restored_while_bodies_part_goes_on_bit_by_bit():
    world = free_world(floor=0.0, gravity=(0, 0, -9.81))
    for i in range(4):
        world.add_body(CUBE, SOFT, position=(0.02 * i, 0, 0.3 + 0.1 * i))
    world.build()
    run(world, 0.1)
    data = world.snapshot()

    def hashes():
        for _ in range(30):
            world.step(DT)
            yield world.state_hash()

    expected = list(hashes())
    world.restore(data)
    assert list(hashes()) == expected


def test_a_body_may_be_refused_where_it_overlaps_another():
    """The message names the body and the depth, which is that of the deepest vertex or middle."""
    world = bare_world(floor=None, soft_contact=True)
    asset = world.add_body(CUBE, SOFT).asset
    world.reserve(asset, 3)
    with pytest.raises(OptionError, match=r"0\.04 m .*body 0"):
        world.add_body(CUBE, SOFT, position=(0.36, 0, 0), overlap="refuse")
    world.build()
    before, count = world.state_hash(), len(world.bodies)
    for position in ((0, 0, 0), (0, 0.36, 0), (0.35, 0.35, 0.35)):
        with pytest.raises(OptionError, match="inside body 0"):
            world.spawn(asset, position=position, overlap="refuse")
    with pytest.raises(OptionError, match=r"overlap 'push'.*'part', 'refuse'"):
        world.spawn(asset, overlap="push")
    assert (world.state_hash(), len(world.bodies)) == (before, count)
    world.spawn(asset, position=(0, 0.4, 0), overlap="refuse")
    world.spawn(asset, position=(0, 0, 0))
