"""Bodies against colliders: friction, motion, restitution, impulses, filters, walls, rest.

Bodies of one world that belong to different experiments share it: each has a group of its own.
"""

import numpy as np
import pytest
import trimesh
from experiments import alone, turn

from taichi_soft import (
    BoxShape,
    CapsuleShape,
    Contact,
    FrozenBodyWarning,
    HeightFieldShape,
    Material,
    MeshShape,
    OptionError,
    PlaneShape,
    SphereShape,
    StateError,
    box,
    sphere,
)
from taichi_soft.world.bare import bare_world

G = 9.81
DT = 1 / 60
FIRM = Material(young=1e6, poisson=0.2, density=1000.0, damping=300.0, damping_ratio=0.0)
BLOCK = box((1.0, 1.0, 0.5), (2, 2, 1))


def add(world, number, mesh, material, **options):
    return world.add_body(mesh, material, contact=Contact(**alone(number)), **options)


def run(world, seconds):
    for _ in range(round(seconds * 60)):
        world.step(DT)


def room(**options):
    """Return a world without a floor. Its capacity is that of most tests."""
    return bare_world(**{"floor": None, "collider_room": 8, **options})


SLOPE = 0.3
SHARES = (0.5, 0.9, 0.98, 1.02, 1.1, 2.0)


@pytest.fixture(scope="module", params=["plane", "turned plane", "box"])
def slides(request):
    """Return the displacements of blocks on an incline every 0.5 s.

    Their friction is given as a multiple of the tangent of its angle.
    """
    tilt = turn(SLOPE, (0.0, 1.0, 0.0))  # down along +x
    world = room()
    for number, share in enumerate(SHARES):
        options = {"friction": share * np.tan(SLOPE), **alone(number)}
        if request.param == "plane":
            world.add_collider(PlaneShape(tilt[:, 2]), **options)
        elif request.param == "turned plane":
            world.add_collider(PlaneShape(), rotation=tilt, **options)
        else:
            size = (60.0, 4.0, 0.1)
            world.add_collider(BoxShape(size), rotation=tilt, position=-0.05 * tilt[:, 2], **options)
        add(world, number, BLOCK, FIRM, position=0.25 * tilt[:, 2], rotation=tilt)
    world.build()
    ways = []
    for _ in range(8):
        run(world, 0.5)
        ways.append([body.center_of_mass() @ tilt[:, 0] for body in world.bodies])
    return np.array(ways)


def test_a_block_slides_on_an_incline_at_and_only_at_the_angle_of_friction(slides):
    """With 2 % more friction the block rests, with 2 % less it slides.

    The first second, in which it sinks in, is ignored.
    """
    gone = slides[-1] - slides[1]
    for share, way in zip(SHARES, gone, strict=True):
        if share > 1:
            assert abs(way) < 2e-4
        else:
            assert way > 0.5 * (1 - share) * G * np.sin(SLOPE) * 4.0


def test_a_sliding_block_is_as_fast_as_the_book_says(slides):
    """The acceleration g (sin a - mu cos a) is compared with second differences of the displacement."""
    measured = (slides[7] - 2 * slides[4] + slides[1]) / 1.5**2
    for share, found in zip(SHARES, measured, strict=True):
        book = max(0.0, (1 - share) * G * np.sin(SLOPE))
        assert found == pytest.approx(book, abs=2e-3 * G * np.sin(SLOPE))


def test_what_friction_holds_does_not_creep_while_it_is_shaken():
    """The body makes 3,840 substeps per second, each of which rounds its position by up to 3e-8 m.

    If these errors accumulated, the body would move by 2e-4 m. A corner that carries almost no weight may
    slip by 0.1 um in each shake.
    """
    tilt = turn(SLOPE, np.array([0.3, 1.0, 0.2]) / np.linalg.norm([0.3, 1.0, 0.2]))
    world = room()
    size = (60.0, 4.0, 0.1)
    world.add_collider(BoxShape(size), rotation=tilt, position=-0.05 * tilt[:, 2], friction=0.8)
    place = tilt @ [0.9, 0.3, 0.125]
    body = world.add_body(box((0.5, 0.5, 0.25), (2, 2, 1)), FIRM, position=place, rotation=tilt)
    world.build()
    for _ in range(300):
        world.step(DT, 64)
    weight = G * body.masses.sum()
    for step in range(240):
        if step == 120:
            before = body.positions().astype(np.float64)
        body.apply_force((-1) ** step * 0.1 * weight * tilt[:, 1])
        world.step(DT, 64)
    ways = (body.positions() - before)[before @ tilt[:, 2] < 1e-3] @ tilt
    assert len(ways) == 9
    assert np.abs(ways[:, :2]).max() < 3e-5


def test_a_moving_belt_carries_a_body_along_once_friction_has_brought_it_to_speed():
    """The displacement is v t - v^2 / (2 mu g). The second term is lost while the body slides."""
    world = room()
    belt = world.add_collider(BoxShape((40.0, 4.0, 1.0)), position=(0, 0, -0.5), friction=0.3)
    body = world.add_body(BLOCK, FIRM, position=(0, 0, 0.25))
    world.build()
    run(world, 1.0)
    start = body.center_of_mass()[0]
    belt.set_velocity((2.0, 0.0, 0.0))
    run(world, 3.0)
    assert belt.position[0] == pytest.approx(6.0, rel=1e-5)
    assert body.center_of_mass()[0] - start == pytest.approx(6.0 - 4.0 / (2 * 0.3 * G), rel=0.02)
    assert body.velocities()[:, 0] == pytest.approx(2.0, abs=0.02)


def test_a_turntable_carries_what_friction_can_hold_and_loses_the_rest():
    """Friction holds a body if w^2 r < mu g."""
    world = room()
    for number, friction in enumerate((0.5, 0.05)):
        table = world.add_collider(
            BoxShape((8.0, 8.0, 0.5)), position=(0, 0, -0.25), friction=friction, **alone(number)
        )
        table.set_velocity((0, 0, 0), (0, 0, 1.2))
        body = add(world, number, BLOCK, FIRM, position=(1.0, 0.0, 0.25))
    world.build()
    for body in world.bodies:
        body.set_velocity((0.0, 1.2, 0.0), (0.0, 0.0, 1.2))
    run(world, 2.5)
    held, lost = (body.center_of_mass()[:2] for body in world.bodies)
    assert np.linalg.norm(held) == pytest.approx(1.0, abs=0.01)
    assert np.arctan2(held[1], held[0]) == pytest.approx(3.0, abs=0.02)
    assert np.linalg.norm(lost) > 1.5


def test_a_piston_pushes_a_body_before_it_and_never_enters_it():
    world = room(floor=0.0)
    piston = world.add_collider(BoxShape((1.0, 2.0, 2.0)), position=(-1.05, 0, 0.5), friction=0.0)
    body = world.add_body(BLOCK, FIRM, position=(0, 0, 0.25))
    world.build()
    run(world, 0.5)
    face, speed = -0.55, 0.5
    for step in range(120):
        face = -0.55 + speed * (step + 1) / 60
        piston.move_to((face - 0.5, 0, 0.5))
        world.step(DT)
        assert body.positions()[:, 0].min() > face - 1e-5
    assert piston.position[0] == pytest.approx(face - 0.5, abs=1e-9)
    run(world, 1.0)  # it comes to rest after sliding at most v^2 / (2 mu g)
    gap = body.positions()[:, 0].min() - face
    assert -1e-5 < gap < 1.5 * speed**2 / (2 * 0.5 * G)
    assert np.abs(body.velocities()).max() < 0.01


RESTITUTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)


def test_vertices_leave_a_collider_with_its_restitution():
    """The body falls flat. At contact no tetrahedron is deformed yet, so v+ = -e v- exactly."""
    world = room(gravity=(0, 0, 0), retries=0)
    for number, restitution in enumerate(RESTITUTIONS):
        world.add_collider(PlaneShape(), restitution=restitution, **alone(number))
        add(world, number, BLOCK, FIRM, position=(0, 0, 0.2515), velocity=(0, 0, -3.0))
    world.build()
    world.step(1e-3, 1)
    soles = BLOCK.vertices[:, 2] < 0.0
    for restitution, body in zip(RESTITUTIONS, world.bodies, strict=True):
        assert body.positions()[soles, 2].max() == pytest.approx(0.0, abs=1e-5)
        np.testing.assert_allclose(body.velocities()[soles, 2], 3.0 * restitution, atol=1e-4)
        np.testing.assert_allclose(body.velocities()[~soles, 2], -3.0, atol=0.5)


@pytest.fixture(scope="module", params=[(1e8, 0.0), (1e7, 300.0), (1e8, 3e4)])
def rebounds(request):
    """Throw stiff balls onto planes at 4 m/s.

    Return measured and requested restitution, and the planes' impulses.
    """
    world = room(gravity=(0, 0, 0))
    for number, restitution in enumerate((None, *RESTITUTIONS)):
        world.add_collider(PlaneShape(), restitution=restitution, **alone(number))
        ball = Material(request.param[0], 0.3, 1000.0, request.param[1])
        add(world, number, sphere(0.5, 2), ball, position=(0, 0, 0.55), velocity=(0, 0, -4.0))
    world.build()
    taken = np.zeros((len(world.colliders), 3))
    for _ in range(30):
        world.step(DT)
        taken += [collider.impulse for collider in world.colliders]
    masses = np.array([body.masses.sum() for body in world.bodies])
    momenta = np.array([body.momentum() for body in world.bodies])
    return momenta[:, 2] / masses / 4.0, taken, momenta + masses[:, None] * [0, 0, 4.0]


def test_a_stiff_ball_leaves_a_collider_with_the_restitution_asked_for_or_its_own_if_that_is_less(rebounds):
    """Newton: v+ = -e v-. A ball without damping has 0.98 of its own, the damped one 0.36."""
    (own, *measured), _, _ = rebounds
    for asked, found in zip(RESTITUTIONS, measured, strict=True):
        assert found == pytest.approx(min(asked, own), abs=0.07)


def test_what_restitution_takes_from_a_body_the_collider_is_told(rebounds):
    _, taken, given = rebounds
    np.testing.assert_allclose(taken, -given, atol=2e-6 * np.abs(given).max())


@pytest.mark.parametrize(("restitution", "lowest", "highest"), [(None, 0.9, 1.0), (0.0, 0.0, 0.07)])
def test_a_floor_among_colliders_has_their_restitution(restitution, lowest, highest):
    world = bare_world(restitution=restitution, gravity=(0, 0, 0), collider_room=1)
    ball = Material(1e8, 0.3, 1000.0, 0.0)
    body = world.add_body(sphere(0.5, 2), ball, position=(0, 0, 0.55), velocity=(0, 0, -4.0))
    world.build()
    for _ in range(30):
        world.step(DT)
    assert lowest <= body.momentum()[2] / body.masses.sum() / 4.0 <= highest


@pytest.fixture(scope="module")
def impact():
    """Throw a spinning ball into a corner of two boxes, a sphere and a plane. Return the impulse on each."""
    world = room(gravity=(0, 0, 0))
    world.add_collider(PlaneShape(), friction=0.4, restitution=0.5)
    world.add_collider(BoxShape((0.5, 6, 6)), position=(1.8, 0, 3.0), rotation=turn(0.2, (0, 0, 1)))
    world.add_collider(BoxShape((6, 0.5, 6)), position=(0, 1.9, 3.0), friction=0.9)
    world.add_collider(SphereShape(0.6), position=(0.9, 1.3, 2.0))
    body = world.add_body(sphere(0.5, 2), Material(1e6, 0.3, 1000.0, 20.0), position=(-0.5, -0.5, 1.5))
    world.build()
    body.set_velocity((5.0, 6.0, -5.0), (3.0, -4.0, 5.0))
    first = body.momentum(), body.angular_momentum()
    taken = np.zeros((len(world.colliders), 6))
    for _ in range(60):
        world.step(DT)
        for row, collider in zip(taken, world.colliders, strict=True):
            row[:3] += collider.impulse
            row[3:] += collider.angular_impulse + np.cross(collider.position, collider.impulse)
        last = np.array([collider.impulse for collider in world.colliders])
    assert not last.any()  # there is no contact any more, so the momentum is exact
    return first, (body.momentum(), body.angular_momentum()), taken


def test_what_colliders_take_up_is_what_the_body_lost_to_round_off(impact):
    (p0, _), (p1, _), taken = impact
    assert np.linalg.norm(p1 - p0) > 0.5 * np.linalg.norm(p0)
    assert (np.linalg.norm(taken[:, :3], axis=1) > 10.0).all()  # all four were hit
    np.testing.assert_allclose(p1 + taken[:, :3].sum(axis=0), p0, atol=2e-5 * np.linalg.norm(p0))


def test_the_turn_that_colliders_take_up_is_what_the_body_lost_to_round_off(impact):
    (p0, l0), (_, l1), taken = impact
    scale = np.linalg.norm(l0) + np.linalg.norm(p0)  # at arms of a metre
    assert np.linalg.norm(l1 - l0) > 0.2 * scale
    np.testing.assert_allclose(l1 + taken[:, 3:].sum(axis=0), l0, atol=1e-4 * scale)


FILTERS = [(1, 1), (2, 1), (1, 2), (3, 6), (4, 7), (2, 2), (1, 0), (0, 1)]


def test_a_body_and_a_collider_touch_where_each_ones_mask_has_the_others_group():
    world = room()
    world.add_collider(PlaneShape(), group=1, mask=3)
    for group, mask in FILTERS:
        world.add_body(BLOCK, FIRM, position=(0, 0, 0.5), contact=Contact(group=group, mask=mask))
    world.build()
    run(world, 1.0)
    for (group, mask), body in zip(FILTERS, world.bodies, strict=True):
        falls = not (group & 3 and mask & 1)
        assert (body.center_of_mass()[2] < -1.0) == falls, (group, mask)


def test_a_skin_keeps_bodies_its_thickness_away():
    world = room()
    thicknesses = (0.0, 0.01, 0.3)
    for number, thickness in enumerate(thicknesses):
        shape = (PlaneShape(), BoxShape((4, 4, 2)), SphereShape(10.0))[number]
        position = ((0, 0, 0), (0, 0, -1.0), (0, 0, -10.0))[number]
        world.add_collider(shape, position=position, thickness=thickness, **alone(number))
        add(world, number, BLOCK, FIRM, position=(0, 0, 0.75))
    world.build()
    run(world, 4.0)
    for thickness, body in zip(thicknesses, world.bodies, strict=True):
        assert body.positions()[:, 2].min() >= thickness - 0.026 * (thickness == 0.3) - 1e-5
        top = body.positions()[:, 2].min()
        assert top == pytest.approx(thickness, abs=1.2e-4 if thickness < 0.3 else 0.03)


FAST = 30.0
WALLED = [  # pose about a skew axis [rad], Young's modulus [Pa], size [m]
    (0.0, 1e6, 1.0),
    (0.4, 1e6, 0.3),
    (1.1, 1e7, 1.0),
    (2.3, 1e7, 0.1),
    (0.8, 5e6, 3.0),
]


@pytest.fixture(scope="module")
def wall_mesh():
    """Make a plate of 2 cm as a mesh shape, with cells of 1 cm."""
    return MeshShape(trimesh.creation.box((0.6, 0.6, 0.02)), cell=0.01, cache=False)


def thrown_at(world, number, pose, young, size):
    """Throw a cube of `size` along x at `FAST`. It starts 1 m before the wall at 0."""
    mesh = box((size, size, size), (2, 2, 2))
    soft = Material(young, 0.3, 1000.0, 0.3 * (size / 2) ** 2 * np.sqrt(1000 * young))
    tilt = turn(pose, np.array([0.6, 0.48, 0.64]))
    return add(world, number, mesh, soft, position=(-size - 1, 0, 0), rotation=tilt, velocity=(FAST, 0, 0))


def test_nothing_passes_a_wall_of_2_cm_at_30_metres_a_second():
    world = bare_world(floor=None, gravity=(0, 0, 0))
    world.add_collider(BoxShape((0.02, 20.0, 20.0)), position=(0.01, 0, 0))
    for pose, young, size in WALLED:
        body = thrown_at(world, 0, pose, young, size)
    world.build()
    outer = [np.unique(body.surface) for body in world.bodies]
    for _ in range(45):
        world.step(DT)
        for body, rows in zip(world.bodies, outer, strict=True):
            assert body.positions()[rows, 0].max() < 1e-4
    for body in world.bodies:
        assert not body.is_frozen
        assert body.center_of_mass()[0] < -0.4 * abs(body.mesh.vertices).max()


def test_nothing_passes_a_mesh_of_two_cells_or_a_fence_of_thin_capsules_at_30_metres_a_second(wall_mesh):
    """The vertices of the thrown box, 3 cm apart, are as dense as the bars, of 2 cm radius, are wide."""
    world = room(gravity=(0, 0, 0), collider_room=0)
    across = turn(np.pi / 2, (0, 1, 0))
    world.add_collider(wall_mesh, rotation=across, position=(0.01, 0, 0), **alone(0))
    poses = (0.7, 0.0, 0.2, 0.6, 1.2)
    for number in range(1, len(poses)):
        for bar in range(-3, 4):
            world.add_collider(CapsuleShape(0.02, 1.0), position=(0.0, 0.07 * bar, 0), **alone(number))
    soft = Material(5e6, 0.3, 1000.0, 5.0)
    for number, pose in enumerate(poses):
        tilt = turn(pose, np.array([0.6, 0.48, 0.64]))
        options = {"position": (-0.5, 0, 0), "rotation": tilt, "velocity": (FAST, 0, 0)}
        add(world, number, box((0.12,) * 3, (4, 4, 4)), soft, **options)
    world.build()
    for _ in range(15):
        world.step(DT)
        for body in world.bodies:
            assert body.center_of_mass()[0] < 0.0
            assert not body.is_frozen
    assert all(body.momentum()[0] < 0.1 * FAST * body.masses.sum() for body in world.bodies)


@pytest.mark.parametrize("speed", [50.0, 200.0])
def test_no_vertex_of_a_thrown_body_passes_the_ground_outside_or_inside(speed):
    """The body is six times as fast as sound in it.

    Its middle must not pass through a skin that has stopped.
    """
    world = room(gravity=(0, 0, 0))
    for number, ground in enumerate((PlaneShape(), HeightFieldShape(np.zeros((9, 9)), 1.0))):
        world.add_collider(ground, **alone(number))
        ball = Material(1e6, 0.3, 1000.0, 5.0)
        options = {"position": (0.13, 0.21, 0.3), "velocity": (0, 0, -speed), "flips": "recover"}
        add(world, number, sphere(0.25, 3), ball, **options)
    world.build()
    for _ in range(30):
        world.step(DT)
        for body in world.bodies:
            assert body.positions()[:, 2].min() > -1e-4
            assert not body.is_frozen
    for body in world.bodies:
        assert body.momentum()[2] > 0.0


CUBE = box((0.5,) * 3, (3, 3, 3))
SOLIDS = [
    (PlaneShape(), (0, 0, 0)),
    (BoxShape((2, 2, 2)), (0, 0, -1)),
    (SphereShape(2.0), (0, 0, -2)),
    (CapsuleShape(1.0, 1.0), (0, 0, -1.5)),
    (HeightFieldShape(np.zeros((5, 5)), 1.0), (0, 0, 0)),
]


def test_a_body_that_starts_crushed_in_a_collider_is_refused_with_collider_and_depth():
    """Build, spawn and teleport refuse it.

    A body slightly inside a collider rises. Pinned or filtered bodies may overlap.
    """
    world = room()
    for number, (solid, place) in enumerate(SOLIDS):
        world.add_collider(solid, position=place, **alone(number))
    for number in range(len(SOLIDS)):
        add(world, number, CUBE, FIRM, position=(0, 0, 0.25 - 0.03))
    add(world, 7, CUBE, FIRM, position=(0, 0, -0.5))
    add(world, 0, CUBE, FIRM, position=(0, 0, 0.1), pinned=np.flatnonzero(CUBE.vertices[:, 2] < 0))
    wrong = add(world, 1, CUBE, FIRM, position=(0, 0, -0.05))
    with pytest.raises(OptionError, match=r"body 7 .*0\.3 m .*collider 1.*BoxShape"):
        world.build()
    assert not world.is_built
    world.despawn(wrong)
    world.build()
    for number, body in enumerate(world.bodies[:5]):
        before = body.positions()
        with pytest.raises(OptionError, match=rf"body {number} .*0\.\d+ m .*collider {number}"):
            body.teleport((0, 0, 0))
        np.testing.assert_array_equal(body.positions(), before)
    with pytest.raises(OptionError, match=r"starts 0\.3 m inside collider 1"):
        world.spawn(wrong.asset, position=(0, 0, -0.05))
    assert len(world.bodies) == 7
    run(world, 2.0)
    for body in world.bodies[:5]:
        assert not body.is_frozen
        assert body.positions()[:, 2].min() > -0.01
        assert np.abs(body.velocities()).max() < 0.1
    world.colliders[1].teleport((0, 0, -1.3))
    assert world.spawn(wrong.asset, position=(0, 0, -0.05)).is_alive


@pytest.mark.parametrize("damping_ratio", [0.0, pytest.param(0.01, marks=pytest.mark.soak)])
def test_a_sheet_of_1_cm_lands_without_freezing(damping_ratio):
    """The sheet is 100 times as wide as thick. It falls from 2 m, flat and tilted."""
    world = room()
    world.add_collider(PlaneShape())
    sheet = box((1.0, 1.0, 0.01), (12, 12, 1))
    for young, tilt in ((1e5, 0.0), (1e5, 0.5), (1e6, 0.5), (1e6, 1.5)):  # the bodies do not meet
        material = Material(young, 0.3, 1000.0, damping_ratio=damping_ratio)
        where = {"position": (0, 0, 2.0), "rotation": turn(tilt, (1.0, 0.0, 0.0))}
        world.add_body(sheet, material, **where)
    world.build()
    run(world, 3.0)
    for body in world.bodies:
        rows = body.positions()
        assert not body.is_frozen
        assert np.isfinite(rows).all()
        assert rows[:, 2].max() < 1.0  # the body has landed


def test_nothing_slips_into_the_seam_between_the_floor_and_a_box_that_stands_on_it_and_moves():
    """The box's lower edge lies in the floor: there its bottom is as near as the face that pushes."""
    world = room(floor=0.0)
    piston = world.add_collider(BoxShape((1.0, 2.0, 2.0)), position=(-1.05, 0, 1.0), friction=0.0)
    body = world.add_body(BLOCK, FIRM, position=(0, 0, 0.25))
    world.build()
    run(world, 0.5)
    for step in range(60):
        face = -0.55 + (step + 1) / 120
        piston.move_to((face - 0.5, 0, 1.0))
        world.step(DT)
        assert body.positions()[:, 0].min() > face - 1e-4


def test_colliders_come_go_and_jump_while_the_world_runs():
    world = room()
    body = world.add_body(BLOCK, FIRM, position=(0, 0, 3.3))
    world.build()
    shelf = world.add_collider(BoxShape((4, 4, 0.2)), position=(0, 0, 2.9))
    run(world, 1.0)
    assert body.positions()[:, 2].min() == pytest.approx(3.0, abs=1e-3)
    ground = world.add_collider(BoxShape((9, 9, 9)), position=(0, 0, -4.5))
    shelf.remove()
    assert world.colliders == (ground,)
    run(world, 2.5)
    assert body.positions()[:, 2].min() == pytest.approx(0.0, abs=3e-4)
    ground.teleport((0, 0, -6.5))
    run(world, 2.0)
    assert body.positions()[:, 2].min() == pytest.approx(-2.0, abs=3e-4)
    lift = world.add_collider(BoxShape((3, 3, 1)), position=(0, 0, -2.5))
    assert lift.index == shelf.index  # it reuses the slot
    for step in range(60):
        lift.move_to((0, 0, -2.5 + (step + 1) / 60))
        world.step(DT)
    run(world, 1.0)
    assert body.positions()[:, 2].min() == pytest.approx(-1.0, abs=3e-4)
    with pytest.raises(StateError, match="removed"):
        shelf.set_velocity((1, 0, 0))


@pytest.fixture(scope="module")
def bowl():
    """Half a hollow ball, outer radius 1.2 m, inner 1 m, its rim at z = 0."""
    angle = np.linspace(0.0, np.pi / 2, 13)
    outer = np.stack([1.2 * np.sin(angle), -1.2 * np.cos(angle)], axis=1)
    inner = np.stack([np.sin(angle), -np.cos(angle)], axis=1)[::-1]
    return MeshShape(trimesh.creation.revolve(np.vstack([outer, inner]), sections=32), cell=0.08, cache=False)


def test_a_body_comes_to_rest_on_every_kind_of_collider(bowl):
    """At rest, the body does not move. In each step, the collider's impulse is the weight times the step."""
    slope = 0.2 * np.add.outer(np.arange(9.0), np.zeros(9))  # 0.2 m in 1 m
    lying = turn(np.pi / 2, (1, 0, 0))
    grounds = [
        (PlaneShape(), {}, BLOCK, 0.3),
        (BoxShape((4, 4, 2)), {"position": (0, 0, -1)}, BLOCK, 0.3),
        (SphereShape(30.0), {"position": (0, 0, -30), "friction": 1.0}, BLOCK, 0.3),
        (CapsuleShape(30.0, 2.0), {"position": (0, 0, -30), "rotation": lying, "friction": 1.0}, BLOCK, 0.3),
        (HeightFieldShape(slope, 1.0), {"position": (0, 0, -0.8)}, BLOCK, 0.4),
        (bowl, {}, sphere(0.4, 2), -0.4),
    ]
    world = room(collider_room=20)
    damped = Material(5e5, 0.3, 1000.0, 600.0)
    for number, (shape, options, mesh, height) in enumerate(grounds):
        world.add_collider(shape, **options, **alone(number))
        add(world, number, mesh, damped, position=(0.02, 0, height))
    world.build()
    for body in world.bodies:
        body.set_linear_damping(2.0)  # rocking and rolling would go on for long
    run(world, 6.0)
    before = [body.positions() for body in world.bodies]
    pushed = np.zeros((len(grounds), 3))
    for _ in range(30):
        world.step(DT)
        pushed += [collider.impulse for collider in world.colliders]
    for (shape, *_), body, start, push in zip(grounds, world.bodies, before, pushed, strict=True):
        assert np.abs(body.positions() - start).max() < 1e-3, shape
        weight = body.masses.sum() * G * 0.5
        np.testing.assert_allclose(push, (0, 0, -weight), atol=0.02 * weight, err_msg=repr(shape))


NAN, INF = float("nan"), float("inf")
REFUSED = {
    "a position that is not finite": lambda w, c: c.move_to((NAN, 0, 0)),
    "two numbers": lambda w, c: c.teleport((0, 0)),
    "a quaternion of length 2": lambda w, c: c.move_to((0, 0, 0), (0, 0, 0, 2)),
    "a matrix that mirrors": lambda w, c: c.teleport((0, 0, 0), np.diag([1, 1, -1])),
    "an infinite velocity": lambda w, c: c.set_velocity((INF, 0, 0)),
    "a spin that is not finite": lambda w, c: c.set_velocity((0, 0, 0), (0, NAN, 0)),
    "words": lambda w, c: c.set_velocity("fast"),
    "negative friction": lambda w, c: w.add_collider(PlaneShape(), friction=-1),
    "restitution above 1": lambda w, c: w.add_collider(PlaneShape(), restitution=1.5),
    "a negative skin": lambda w, c: w.add_collider(PlaneShape(), thickness=-0.1),
    "a group of half a bit": lambda w, c: w.add_collider(PlaneShape(), group=0.5),
    "a mask below 0": lambda w, c: w.add_collider(PlaneShape(), mask=-1),
    "no shape": lambda w, c: w.add_collider("box"),
    "a place out of reach": lambda w, c: w.add_collider(PlaneShape(), position=(0, 0, 1e9)),
    "one more than there is room for": lambda w, c: w.add_collider(PlaneShape()),
    "a removed handle": lambda w, c: w.removed.remove(),
    "a removed handle to read": lambda w, c: w.removed.impulse,
}


def test_grounds_come_and_go_while_the_world_runs():
    """Bodies on a ground stay in place while other grounds come and go, as long as `sample_room` lasts."""
    world = room(collider_room=5, sample_room=4 * 64 * 128)
    bodies = [world.add_body(BLOCK, FIRM, position=(x, 0, 0.27)) for x in (0.0, 20.0)]
    world.build()
    grounds = [HeightFieldShape(np.full((64, 128), 0.1 * i), 0.1) for i in range(3)]
    first = world.add_collider(grounds[0])
    second = world.add_collider(grounds[1], position=(20, 0, -0.1))
    others = [world.add_collider(grounds[2], position=(0, 0, -9)) for _ in range(2)]
    with pytest.raises(StateError, match=r"8,192 samples.* room for 0: .*sample_room") as refusal:
        world.add_collider(grounds[2])
    assert len(str(refusal.value)) < 300
    run(world, 0.5)
    data = world.snapshot()
    for time in range(6):
        others[time % 2].remove()
        ball = world.add_collider(SphereShape(0.1), position=(0, 0, -30))
        others[time % 2] = world.add_collider(grounds[time % 3], position=(time, 0, -9))
        ball.remove()
        run(world, 1 / 12)
    lows = [body.positions()[:, 2].min() for body in bodies]
    np.testing.assert_allclose(lows, [0.0, 0.0], atol=2e-3)
    second.remove()
    world.add_collider(grounds[0], position=(20, 0, -3))
    run(world, 0.5)
    assert bodies[1].positions()[:, 2].min() < -0.5
    assert bodies[0].positions()[:, 2].min() == pytest.approx(0.0, abs=2e-3)
    world.restore(data)
    assert second.is_alive
    run(world, 0.5)
    lows = [body.positions()[:, 2].min() for body in bodies]
    np.testing.assert_allclose(lows, [0.0, 0.0], atol=2e-3)
    assert first.impulse[2] < 0
    assert repr(grounds[1]) == "HeightFieldShape(64 x 128 nodes, spacing=0.1, heights from 0.1 to 0.1 m)"


MOST = 32
"""Colliders of a world, which makes room for a power of two."""


def full_world():
    """Make a world with a body that slides on a moving box.

    All collider slots are used, except one removed collider.
    """
    world = room(collider_room=MOST - 1)
    moving = world.add_collider(BoxShape((9, 9, 1)), position=(0, 0, -0.5))
    world.add_body(BLOCK, FIRM, position=(0, 0, 0.26))
    world.build()
    moving.set_velocity((0.5, 0.2, 0.1), (0, 0, 0.3))
    world.removed = world.add_collider(PlaneShape(), mask=0)
    world.removed.remove()
    for _ in range(MOST - 1):
        world.add_collider(PlaneShape(), mask=0)
    return world, moving


def test_a_refused_call_changes_nothing():
    """Refused calls between steps do not change the final state, bit by bit."""
    ends = []
    for tries in (REFUSED, {}):
        world, moving = full_world()
        for _ in range(3):
            for wrong in tries.values():
                with pytest.raises((OptionError, StateError)):
                    wrong(world, moving)
            run(world, 1 / 12)
        ends.append(
            (world.bodies[0].positions(), world.bodies[0].velocities(), moving.position, moving.rotation)
        )
        assert len(world.colliders) == MOST
        del world, moving
    for one, other in zip(*ends, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_body_that_breaks_among_colliders_tells_where():
    world = bare_world(collider_room=1, retries=0)
    world.add_collider(BoxShape((1.0, 1.0, 1.0)), position=(0.9, 0.0, 0.5))
    body = world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), position=(0, 0, 1.6))
    world.build()
    fast = 9e3 * np.where(np.arange(body.vertex_count) % 2, 1, -1)
    body.set_motion(body.positions(), fast[:, None] * np.ones(3))
    with pytest.warns(FrozenBodyWarning):
        world.step(1 / 60, 8)
    assert body.failure.tetrahedron is not None
    assert body.failure.step == 0


@pytest.mark.parametrize("integrator", ["leapfrog", "lazy_leapfrog"])
def test_a_body_beside_a_wall_falls_freely_and_lands(integrator):
    """Next to a wall without contact, z = z0 - g t^2 / 2. Then the floor carries the weight."""
    world = bare_world(integrator=integrator, collider_room=8)
    body = world.add_body(box(cells=(2, 2, 2)), FIRM, position=(0.0, 0.0, 1.0))
    world.add_collider(PlaneShape((1.0, 0.0, 0.0)), position=(-0.51, 0.0, 0.0))
    world.build()
    start = body.center_of_mass()
    run(world, 0.25)
    fall = 0.5 * G * 0.25**2
    first_order = 0.5 * G * 0.25 / 60  # by the lazy variant, velocities begin at the time of the positions
    assert start[2] - body.center_of_mass()[2] == pytest.approx(fall, abs=1.01 * first_order + 1e-3)
    run(world, 3.0)
    assert body.center_of_mass()[2] == pytest.approx(0.5, abs=0.02)
