"""Rigid bodies: motion, contact, joints. Oracles: equations in float64, closed forms, conservation laws."""

import numpy as np
import pytest

from taichi_soft import (
    BoxShape,
    Contact,
    ContactBegan,
    FellAsleep,
    Material,
    MeshError,
    OptionError,
    PlaneShape,
    SoftBodyAsset,
    SpringMaterial,
    World,
    box,
    cloth,
    cloth_constants,
    sphere,
)

DT, G = 1 / 60, 9.81
JELLY = Material(young=5e5, poisson=0.4, density=500.0, damping_ratio=0.1)


def center(body):
    return body.masses @ body.positions().astype(np.float64) / body.masses.sum()


def momenta(bodies):
    """Return momentum [N s] and angular momentum about the origin [N m s] of bodies."""
    linear, angular = np.zeros(3), np.zeros(3)
    for body in bodies:
        m, x, v = body.masses[:, None], body.positions().astype(float), body.velocities().astype(float)
        linear += (m * v).sum(axis=0)
        angular += (m * np.cross(x, v)).sum(axis=0)
    return linear, angular


def step(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def test_four_particles_have_the_mass_centre_and_inertia_of_a_solid():
    """A box with the edges a, b, c has I = m / 12 diag(b^2 + c^2, a^2 + c^2, a^2 + b^2)."""
    a, b, c, mass = 0.6, 0.3, 0.1, 7.0
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shape, at = box((a, b, c), (2, 1, 1)), np.array([0.3, -0.2, 1.0])
    rows = shape.vertices @ turn.T + at
    asset = SoftBodyAsset.rigid((rows, shape.surface), mass=mass)
    m, r = asset.description.masses, asset.mesh.vertices - at
    inertia = (
        m[:, None, None] * ((r**2).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None])
    ).sum(axis=0)
    wanted = mass / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    assert m.sum() == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(m @ r, 0, atol=1e-12)
    np.testing.assert_allclose(inertia, turn @ wanted @ turn.T, atol=1e-12)


def tumbling(edges, spin, seconds, h=1e-4):
    """Integrate Euler's equations by Runge and Kutta's method: the rotation after `seconds`."""
    a, b, c = edges
    moments = np.array([b * b + c * c, a * a + c * c, a * a + b * b]) / 12

    def rate(state):
        q, w = state[:4], state[4:]  # quaternion (w, x, y, z), angular velocity in the frame of the body
        scalar, v = q[0], q[1:]
        dq = 0.5 * np.r_[-v @ w, scalar * w + np.cross(v, w)]
        return np.r_[dq, -np.cross(w, moments * w) / moments]

    state = np.r_[1.0, 0, 0, 0, spin]
    for _ in range(round(seconds / h)):
        k1 = rate(state)
        k2 = rate(state + h / 2 * k1)
        k3 = rate(state + h / 2 * k2)
        k4 = rate(state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    w, x, y, z = state[:4] / np.linalg.norm(state[:4])
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_a_body_that_turns_about_its_middle_axis_turns_over_as_by_eulers_equations():
    edges, spin = (0.1, 0.3, 0.6), np.array([0.02, 4.0, 0.02])
    arena = World(gravity=(0, 0, 0), floor=None)
    body = arena.add_rigid(box(edges, (1, 1, 1)), density=1000, angular_velocity=spin)
    arena.build()
    before, least = momenta([body]), 1.0
    for second in range(1, 5):
        for _ in range(60):
            arena.step(DT, 20)
        wanted = tumbling(edges, spin, second)
        least = min(least, wanted[1, 1])
        np.testing.assert_allclose(body.pose().rotation, wanted, atol=0.03)
    after = momenta([body])
    assert least < -0.9  # it turned over
    np.testing.assert_allclose(after[1], before[1], atol=2e-6 * np.linalg.norm(before[1]))


@pytest.mark.parametrize(("friction", "degrees"), [(0.5, 20), (0.3, 20), (0.3, 30)])
def test_a_crate_on_a_slope_rests_or_slides_by_coulombs_law(friction, degrees):
    angle = np.radians(degrees)
    arena = World(floor=None, gravity=(G * np.sin(angle), 0, -G * np.cos(angle)), sleep_speed=0)
    arena.add_collider(PlaneShape(), friction=friction)
    crate = arena.add_rigid(box((0.4, 0.4, 0.2), (1, 1, 1)), mass=3.0, position=(0, 0, 0.1))
    arena.build()
    step(arena, 1.0)
    wanted = 0.5 * G * max(0.0, np.sin(angle) - friction * np.cos(angle))
    assert center(crate)[0] == pytest.approx(wanted, rel=2e-3, abs=1e-6)
    assert abs(center(crate)[2] - 0.1) < 1e-4


def test_a_pin_of_1_cm_under_the_middle_of_a_plate_of_50_cm_carries_its_weight():
    world = World(floor=None, sleep_speed=0)
    pin = world.add_collider(BoxShape((0.01, 0.01, 0.4)))
    plate = world.add_rigid(box((0.5, 0.5, 0.05)), mass=1.0, position=(0, 0, 0.3))
    world.build()
    for _ in range(40):
        world.step(DT)
    assert plate.center_of_mass()[2] == pytest.approx(0.225, abs=1e-3)
    assert pin.impulse / DT == pytest.approx([0, 0, -9.81], abs=0.1)


def test_a_stack_of_ten_crates_carries_its_weight_sleeps_and_does_not_creep():
    arena = World()
    crates = [
        arena.add_rigid(
            box((0.5, 0.5, 0.5), (1, 1, 1)), mass=10.0, position=(0.01 * (i % 2), 0, 0.25 + 0.51 * i)
        )
        for i in range(10)
    ]
    arena.build()
    step(arena, 0.75)
    floor = next(each for each in arena.colliders)
    total = sum(crate.masses.sum() for crate in crates)
    assert -floor.impulse[2] / DT == pytest.approx(total * G, rel=0.02)
    step(arena, 2.0)
    places = [center(crate) for crate in crates]
    assert all(crate.is_asleep for crate in crates)
    for i, place in enumerate(places):
        assert abs(place[2] - 0.25 - 0.505 * i) < 0.002 * (i + 1)
        assert np.abs(place[:2] - [0.01 * (i % 2), 0]).max() < 1e-3


@pytest.mark.parametrize(("crate_mass", "is_above"), [(1.0, True), (30.0, True), (1.0, False)])
def test_a_crate_and_a_jelly_of_500_kg_hold_each_other(crate_mass, is_above):
    arena = World()
    heights = (1.16, 0.5) if is_above else (0.15, 0.81)
    crate = arena.add_rigid(box((0.3, 0.3, 0.3), (1, 1, 1)), mass=crate_mass, position=(0, 0, heights[0]))
    jelly = arena.add_body(box((1, 1, 1), (5, 5, 5)), JELLY, position=(0, 0, heights[1]))
    arena.build()
    step(arena, 2.0)
    bottom = jelly.positions()[:, 2].min()
    if is_above:
        assert 1.1 < center(crate)[2] < 1.16
    else:  # the jelly bends over the crate, and neither passes through the other
        assert abs(center(crate)[2] - 0.15) < 0.005
        inside = np.abs(jelly.positions() - center(crate)).max(axis=1) < 0.14
        assert not inside.any()
    assert bottom > -0.005
    assert np.linalg.norm(center(crate)[:2]) < 0.05


def test_two_crates_that_collide_keep_momentum_and_angular_momentum():
    arena = World(gravity=(0, 0, 0), floor=None)
    first = arena.add_rigid(
        box((0.4, 0.3, 0.2), (1, 1, 1)), mass=3.0, velocity=(4, 0, 0), angular_velocity=(1, 2, 3)
    )
    second = arena.add_rigid(box((0.3, 0.3, 0.3), (1, 1, 1)), mass=1.0, position=(1.0, 0.12, 0.07))
    arena.build()
    step(arena, 0.05)
    before = momenta([first, second])
    step(arena, 0.5)
    after = momenta([first, second])
    assert np.linalg.norm(second.velocities().mean(axis=0)) > 2.0  # it was hit
    size = 3.0 * 4.0
    np.testing.assert_allclose(after[0], before[0], atol=2e-6 * size)
    np.testing.assert_allclose(after[1], before[1], atol=1e-5 * size)


def test_a_hinged_bar_swings_with_the_period_of_a_physical_pendulum():
    arena = World(floor=None)
    base = arena.add_rigid(box((1, 1, 1), (1, 1, 1)), mass=100.0, position=(0, 0, 2))
    bar = arena.add_rigid(box((0.1, 0.05, 1.0), (1, 1, 1)), mass=2.0, position=(0, 0.9, 1.0))
    arena.build()
    base.pin(range(4))
    hinge = arena.connect(bar, base, "hinge", anchor=(0, 0.9, 1.5), axis=(0, 1, 0))
    bar.apply_impulse((0.2, 0, 0))
    track = []
    for _ in range(400):
        arena.step(DT)
        track.append(center(bar))
    x = np.array(track)
    rises = np.flatnonzero((x[:-1, 0] < 0) & (x[1:, 0] >= 0))
    times = rises - x[rises, 0] / (x[rises + 1, 0] - x[rises, 0])
    inertia = 2.0 * (1.0 + 0.1**2) / 12 + 2.0 * 0.5**2
    assert np.diff(times).mean() * DT == pytest.approx(
        2 * np.pi * np.sqrt(inertia / (2.0 * G * 0.5)), rel=1e-3
    )
    assert np.abs(x[:, 1] - 0.9).max() < 1e-4
    assert hinge.force[2] == pytest.approx(2.0 * G, rel=0.02)


def test_a_slider_lets_a_body_slide_along_its_axis_only():
    arena = World(floor=None)
    base, body = (
        arena.add_rigid(box((0.2, 0.2, 0.2), (1, 1, 1)), mass=1.0, position=(0.3 * i, 0, 2)) for i in range(2)
    )
    arena.build()
    base.pin(range(4))
    arena.connect(body, base, "slider", anchor=(0.15, 0, 2), axis=(1, 0, -1))
    step(arena, 1.0)
    np.testing.assert_allclose(center(body) - [0.3, 0, 2], G / 4 * np.array([1, 0, -1]), atol=0.01)
    np.testing.assert_allclose(body.pose().rotation, np.eye(3), atol=0.01)


def test_two_bodies_that_are_fixed_to_each_other_turn_as_one_and_keep_their_momenta():
    arena = World(gravity=(0, 0, 0), floor=None)
    first = arena.add_rigid(box((0.2, 0.2, 0.2), (1, 1, 1)), mass=1.0, angular_velocity=(1, 2, 3))
    second = arena.add_rigid(box((0.3, 0.2, 0.2), (1, 1, 1)), mass=2.0, position=(0.5, 0, 0))
    arena.build()
    arena.connect(first, second, "fixed", anchor=(0.25, 0, 0))
    before = momenta([first, second])
    step(arena, 5.0)
    after = momenta([first, second])
    mine, theirs = first.pose(), second.pose()
    np.testing.assert_allclose(mine.rotation.T @ theirs.rotation, np.eye(3), atol=1e-4)
    np.testing.assert_allclose(mine.rotation.T @ (theirs.position - mine.position), [0.5, 0, 0], atol=1e-4)
    np.testing.assert_allclose(after[0], before[0], atol=1e-5)
    np.testing.assert_allclose(after[1], before[1], atol=2e-4 * np.linalg.norm(before[1]))


def test_a_light_ball_bounces_on_a_taut_sheet_and_contact_makes_no_energy():
    """The total energy is that of both motions, of gravity, and of the springs, 1/2 k (l - l0)^2."""
    arena = World(floor=None)
    mesh = cloth((2.0, 2.0), (16, 16), mass=0.2)
    stiffness = cloth_constants(mesh, (16, 16), tensile=1500, shear=750, bend=30)
    rest = 0.8 * mesh.edge_lengths
    rim = np.flatnonzero(np.abs(mesh.vertices[:, :2]).max(axis=1) > 0.999)
    sheet = arena.add_body(mesh, SpringMaterial(stiffness, damping=0.0, rest_length=rest), pinned=rim)
    ball = arena.add_rigid(sphere(radius=0.15, resolution=3), mass=0.5, position=(0.03, 0.02, 0.5))
    arena.build()

    def energy():
        x = sheet.positions().astype(np.float64)
        lengths = np.linalg.norm(np.diff(x[mesh.edges], axis=1)[:, 0], axis=1)
        total = 0.5 * (stiffness * (lengths - rest) ** 2).sum()
        for body in (sheet, ball):
            total += 0.5 * (body.masses[:, None] * body.velocities().astype(np.float64) ** 2).sum()
            total += G * body.masses @ body.positions()[:, 2].astype(np.float64)
        return total

    start, drop, heights = energy(), 0.5 * G * 0.35, []
    for _ in range(80):
        arena.step(DT)
        heights.append(center(ball)[2])
        assert energy() - start < 0.1 * drop
    first = int(np.argmax(np.array(heights) < 0.14))
    assert min(heights) > 0.05  # the sheet holds it
    assert max(heights[first:]) > 0.152  # and throws it off


def test_two_soft_fingers_lift_a_crate():
    arena = World()
    crate = arena.add_rigid(box((0.2, 0.2, 0.2), (1, 1, 1)), mass=0.5, on_floor=True)
    finger = SoftBodyAsset(
        box((0.1, 0.15, 0.15), (3, 4, 4)),
        Material(young=2e5, poisson=0.4, density=500, damping_ratio=0.3),
        contact=Contact(friction=0.9),
    )
    sides = [arena.add_body(finger, position=(side * 0.17, 0, 0.12)) for side in (-1, 1)]
    arena.build()
    for side, body in zip((-1, 1), sides, strict=True):
        outer = np.flatnonzero(side * finger.mesh.vertices[:, 0] > 0.049)
        body.pin(outer)
    for i in range(150):
        for side, body in zip((-1, 1), sides, strict=True):
            outer = np.flatnonzero(side * finger.mesh.vertices[:, 0] > 0.049)
            squeeze, lift = 0.035 * min(1.0, i / 40), 0.3 * np.clip((i - 50) / 80, 0, 1)
            goal = finger.mesh.vertices[outer] + [side * (0.17 - squeeze), 0, 0.12 + lift]
            body.set_targets(outer, goal)
        arena.step(DT)
    assert center(crate)[2] == pytest.approx(0.1 + 0.3, abs=0.03)


def test_a_ray_hits_the_surface_and_a_grab_lifts_the_body():
    arena = World()
    crate = arena.add_rigid(box((0.5, 0.5, 0.5), (1, 1, 1)), mass=10.0, on_floor=True)
    arena.build()
    hit = arena.raycast((0.1, 0.2, 5), (0, 0, -1))
    assert hit.body is crate
    np.testing.assert_allclose(hit.point, [0.1, 0.2, 0.5], atol=1e-5)
    corners = crate.mesh.points[hit.vertices] + [0, 0, 0.25]
    np.testing.assert_allclose(hit.barycentrics @ corners, hit.point, atol=1e-5)
    grab = crate.grab(hit.triangle, hit.barycentrics, frequency=3.0)
    grab.move((0.1, 0.2, 1.5))
    step(arena, 4.0)
    pose = crate.pose()
    held = pose.rotation @ [0.1, 0.2, 0.25] + pose.position
    sag = G / (2 * np.pi * 3.0) ** 2  # weight over stiffness
    np.testing.assert_allclose(held, [0.1, 0.2, 1.5 - sag], atol=0.05)
    assert grab.force[2] == pytest.approx(10.0 * G, rel=0.3)


def test_a_heap_of_rigid_bodies_continues_from_a_snapshot_with_the_same_bits():
    arena = World()
    crate = SoftBodyAsset.rigid(box((0.4, 0.3, 0.2), (1, 1, 1)), mass=2.0)
    arena.reserve(crate, 6)
    for i in range(6):
        arena.spawn(crate, position=(0.05 * i, 0.02 * i, 0.3 + 0.3 * i), angular_velocity=(i, 1, 0))
    arena.build()
    step(arena, 0.7)
    kept = arena.snapshot()
    step(arena, 0.5)
    wanted = arena.state_hash()
    arena.restore(kept)
    step(arena, 0.5)
    assert arena.state_hash() == wanted


def test_a_crate_hangs_on_a_soft_beam_and_a_soft_block_on_a_crate():
    """Each joint bears the weight that hangs on it."""
    arena = World(floor=None)
    beam = arena.add_body(box((0.4, 0.4, 0.4), (3, 3, 3)), JELLY, position=(0, 0, 2))
    crate = arena.add_rigid(box((0.3, 0.3, 0.3)), mass=4.0, position=(0, 0, 1.6))
    block = arena.add_body(box((0.2, 0.2, 0.2), (2, 2, 2)), JELLY, position=(0, 0, 1.34))
    arena.build()
    beam.pin(np.flatnonzero(beam.mesh.vertices[:, 2] > 0.19))
    upper = arena.connect(crate, beam, "fixed", anchor=(0, 0, 1.78))
    lower = block.attach_to(crate, np.flatnonzero(block.mesh.vertices[:, 2] > 0.09))
    step(arena, 4.0)
    of_block = block.masses.sum() * G
    assert lower.force[2] == pytest.approx(of_block, rel=0.02)
    assert upper.force[2] == pytest.approx(4.0 * G + of_block, rel=0.02)
    assert np.linalg.norm(center(crate)[:2]) < 0.01


def test_events_tell_when_a_crate_lands_and_falls_asleep():
    arena = World()
    crate = arena.add_rigid(box((0.3, 0.3, 0.3)), mass=4.0, position=(0, 0, 0.5))
    arena.build()
    arena.record_events()
    step(arena, 2.0)
    told = arena.drain_events()
    assert [type(event) for event in told] == [ContactBegan, FellAsleep]
    assert told[0].a is told[1].body is crate
    assert told[0].time == pytest.approx(np.sqrt(2 * 0.35 / G), abs=2 * DT)


def test_bad_input_is_refused_with_a_way_out():
    arena = World()
    shape = box((0.5, 0.5, 0.5), (1, 1, 1))
    with pytest.raises(OptionError, match="either mass or density"):
        arena.add_rigid(shape)
    with pytest.raises(MeshError, match="closed"):
        arena.add_rigid((shape.vertices, shape.surface[1:]), mass=1.0)
    with pytest.raises(MeshError, match="counterclockwise"):
        arena.add_rigid((shape.vertices, shape.surface[:, ::-1]), mass=1.0)
    with pytest.raises(OptionError, match="mass"):
        arena.add_rigid(shape, mass=-1.0)
    crate = arena.add_rigid(shape, mass=1.0, on_floor=True)
    soft = arena.add_body(shape, JELLY, position=(2, 0, 1))
    arena.build()
    with pytest.raises(OptionError, match=r"world\.connect"):
        crate.attach_to(soft, [0])
    with pytest.raises(OptionError, match="not rigid"):
        arena.connect(soft, crate, "ball", anchor=(0, 0, 1))
    with pytest.raises(OptionError, match="two rigid bodies"):
        arena.connect(crate, soft, "slider", anchor=(0, 0, 1))
    with pytest.raises(OptionError, match="unknown joint_kind 'bal'"):
        arena.connect(crate, soft, "bal", anchor=(0, 0, 1))
    with pytest.raises(OptionError, match="zero length"):
        arena.connect(crate, soft, "hinge", anchor=(0, 0, 1), axis=(0, 0, 0))
