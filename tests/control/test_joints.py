"""Joints between bodies: their forces, and their independence of everything else."""

import numpy as np
import pytest

from taichi_soft import (
    Contact,
    Material,
    OptionError,
    SpringMaterial,
    StateError,
    box,
    rope,
)
from taichi_soft.control.kernels.joints import JOINT_ROWS, MOST_JOINTS
from taichi_soft.world.bare import bare_world

G, DT = 9.81, 1 / 60
BIG, SMALL = box(cells=(2, 2, 2)), box((0.7, 0.6, 0.5), (3, 3, 2))  # whose vertices lie nowhere alike
JELLY = Material(1e5, 0.3, 1000.0, 20.0)
CALM = Material(1e5, 0.3, 1000.0, 0.0)
LIGHT = Material(2e4, 0.3, 3.0, 0.05)
ABOVE = np.array([0.1, -0.05, 0.75])  # position of the small body on the big one
UNDER = np.flatnonzero(SMALL.vertices[:, 2] < -0.24)
TOP = np.flatnonzero(BIG.vertices[:, 2] > 0.49)
BOTTOM = np.flatnonzero(BIG.vertices[:, 2] < -0.49)
WAYS = {
    "soft": {"soft_contact": True},
    "through": {"collider_room": 1},
    "implicit": {"integrator": "implicit_euler", "tolerance": 1e-6, "most_iterations": 2000},
}


@pytest.fixture(scope="module")
def made():
    """Per kind of world a small body on a big one, and two blocks far away."""
    worlds = {}
    for name, options in WAYS.items():
        world = bare_world(floor=None, **options)
        world.add_body(BIG, CALM)
        world.add_body(SMALL, CALM, position=ABOVE)
        world.add_body(BIG, JELLY, position=(0, -50, 0))
        world.add_body(BIG, JELLY, position=(0, 50, 0))
        world.build()
        worlds[name] = world
    return worlds


def afresh(world):
    """Without joints, gravity, pins and motion."""
    for joint in list(world.joints):
        joint.release()
    for body, place in zip(world.bodies, ((0, 0, 0), ABOVE, (0, -50, 0), (0, 50, 0)), strict=True):
        body.unpin()
        body.set_gravity_scale(0.0)
        body.set_linear_damping(0.0)
        body.set_material(body.asset.material)
        body.set_motion(body.mesh.vertices + place, np.zeros((body.vertex_count, 3)))
    return world, *world.bodies


@pytest.fixture(
    params=["through", *(pytest.param(way, marks=pytest.mark.soak) for way in ("soft", "implicit"))]
)
def joined(request, made):
    return afresh(made[request.param])


@pytest.fixture
def soft(made):
    return afresh(made["soft"])


def shake(body, speed, seed):
    """Every vertex somewhere else."""
    rng = np.random.default_rng(seed)
    body.set_motion(body.positions(), rng.normal(0, speed, (body.vertex_count, 3)))


def places_in(mesh, points):
    """Vertices and weights of the tetrahedron round each point, by its volumes: (n, 4) each."""
    found = []
    for point in points:
        corners = mesh.vertices[mesh.tets]
        volumes = np.empty(corners.shape[:2])
        for i in range(4):
            moved = corners.copy()
            moved[:, i] = point
            volumes[:, i] = np.linalg.det(moved[:, 1:] - moved[:, :1])
        weights = volumes / volumes.sum(axis=1, keepdims=True)
        best = np.argmax(weights.min(axis=1))
        found.append((mesh.tets[best], weights[best]))
    return np.array([f[0] for f in found]), np.array([f[1] for f in found])


def sums(*bodies):
    """Momentum and angular momentum of all together, by NumPy in float64; and what would be a lot of each."""
    p, spin, much = np.zeros(3), np.zeros(3), 0.0
    for body in bodies:
        x, v = body.positions().astype(float), body.velocities().astype(float)
        mv = body.masses[:, None] * v
        p, spin = p + mv.sum(axis=0), spin + np.cross(x, mv).sum(axis=0)
        much += np.abs(mv).sum()
    return p, spin, much


def state_of(world):
    state = world._built.state
    names = ("particle_position", "particle_velocity", "body_drives", "body_status")
    rows = [getattr(state, name).to_numpy().tobytes() for name in names]
    joints = [getattr(state.joints, name).to_numpy().tobytes() for name in ("bodies", "rows", "particle")]
    return rows, joints, list(world.joints), world._handles.count


# Worlds that end with their test come first, so that later worlds reuse their kernels.


def test_rows_run_out_and_come_back():
    grain = box(cells=(7, 7, 7))
    world = bare_world(floor=None, collider_room=1)
    a, b = (world.add_body(grain, JELLY, position=(3 * i, 0, 0)) for i in range(2))
    world.build()
    every = np.arange(512)
    joints = [a.attach_to(b, every, onto=every) for _ in range(JOINT_ROWS // 512)]
    before = state_of(world)
    with pytest.raises(StateError, match=f"{JOINT_ROWS} .*{JOINT_ROWS} .*1 more"):
        a.attach_to(b, [0], onto=[0])
    assert state_of(world) == before
    joints[1].release()
    a.attach_to(b, [0], onto=[0])
    state = world._built.state.joints
    bodies, rows, ends = state.bodies.to_numpy(), state.rows.to_numpy(), state.particle.to_numpy()
    assert bodies[:5].tolist() == [[1, 2]] * 4 + [[0, 0]]
    assert rows[:4].tolist() == [[0, 512], [1536, 1537], [512, 1024], [1024, 1536]]
    assert (ends[: 1536 * 8].reshape(3, -1) == ends[: 512 * 8]).all()
    for _ in range(3):
        world.step(DT)
    assert not a.is_frozen


@pytest.mark.soak
def test_a_joint_works_whatever_groups_say():
    world = bare_world(floor=None, soft_contact=True)
    a = world.add_body(BIG, JELLY, contact=Contact(mask=0))
    b = world.add_body(BIG, JELLY, position=(0, 0, -1), contact=Contact(group=4, mask=0))
    world.build()
    a.pin(TOP)
    joint = b.attach_to(a, TOP)
    for body in (a, b):
        body.set_linear_damping(5.0)
    for _ in range(240):
        world.step(DT)
    assert joint.force[2] == pytest.approx(1000 * G, rel=0.01)


@pytest.mark.soak
def test_a_rope_is_held_by_a_body_and_by_a_rope():
    world = bare_world(floor=None, collider_room=1)
    line = rope(1.0, 8, 0.5)
    far = int(np.argmax(line.vertices[:, 0]))
    near = int(np.argmin(line.vertices[:, 0]))
    corner = int(np.argmax(BIG.vertices @ (1, 0.01, -1)))
    place = BIG.vertices[corner] - line.vertices[near]
    block = world.add_body(BIG, JELLY)
    a = world.add_body(line, SpringMaterial(3000.0, 0.5), law="springs", position=place)
    b = world.add_body(
        line, SpringMaterial(3000.0, 0.5), law="springs", position=place + np.array([1.3, 0, 0])
    )
    world.build()
    block.pin(np.arange(27))
    upper = a.attach_to(block, [near])
    lower = b.attach_to(a, [near], onto=[far])
    for each in (a, b):
        each.set_linear_damping(3.0)
    for _ in range(480):
        world.step(DT, 40)
    np.testing.assert_allclose(upper.force, [0, 0, 1.0 * G], atol=0.02 * G)
    np.testing.assert_allclose(lower.force, [0, 0, 0.5 * G], atol=0.02 * G)
    np.testing.assert_allclose(b.positions()[near], a.positions()[far], atol=1e-3)
    with pytest.raises(OptionError, match="has no tetrahedra"):
        block.attach_to(a, [corner])


@pytest.mark.parametrize("gap", [0.0, 0.08])
def test_momentum_and_angular_momentum_stay(joined, gap):
    """Momenta of two tumbling, vibrating bodies with a joint between meshes that do not match are conserved.

    They are also conserved while the joint closes a gap. The tolerance is the round-off of float32, relative
    to the sum of all |m v|; bodies are about 1 m wide.
    """
    world, big, small, *_ = joined
    joint = small.attach_to(big, UNDER)
    if gap:
        small.teleport(small.center_of_mass() + np.array([0.3, -0.2, 0.9]) * gap)
    shake(big, 0.3, 1)
    shake(small, 0.6, 2)
    small.apply_impulse((30.0, 20.0, -10.0), [0])
    p, spin, much = sums(big, small)
    for _ in range(60):
        world.step(DT, 20)
        now_p, now_spin, _ = sums(big, small)
        np.testing.assert_allclose(now_p, p, atol=1e-5 * much)
        np.testing.assert_allclose(now_spin, spin, atol=1e-5 * much)
    assert np.linalg.norm(joint.force) > 10.0


def test_particles_stay_at_their_places(joined):
    world, big, small, *_ = joined
    tets, weights = places_in(BIG, small.positions()[UNDER].astype(float))
    small.attach_to(big, UNDER)
    shake(big, 0.5, 3)
    small.set_velocity((1.0, 0.5, 0.0), (0.0, 2.0, 3.0))
    for _ in range(60):
        world.step(DT)
        places = np.einsum("nk,nka->na", weights, big.positions()[tets].astype(float))
        assert np.abs(small.positions()[UNDER] - places).max() < 2e-4
    assert not big.is_frozen


def test_a_joint_takes_energy_out_and_puts_none_in(joined):
    world, big, small, *_ = joined
    for body in (big, small):
        body.set_velocity((0, 0, 0))
    small.set_velocity((2.0, 1.0, 3.0), (0, 1, 2))
    before = small.kinetic_energy()
    small.attach_to(big, UNDER)
    for _ in range(60):
        world.step(DT, 20)
        assert sum(body.kinetic_energy() for body in (big, small)) < before
    velocity = sums(big, small)[0] / 1210.0
    np.testing.assert_allclose(velocity, 210.0 / 1210.0 * np.array([2.0, 1.0, 3.0]), atol=1e-3)


def test_a_hanging_chain_carries_what_hangs_below(joined):
    """Each joint its m g; the pins all of it."""
    world, big, _, block, _ = joined
    for body in (big, block):
        body.set_gravity_scale(1.0)
        body.set_material(JELLY)
        body.set_linear_damping(5.0)
    block.teleport((0, 0, -1))
    big.pin(TOP)
    joint = block.attach_to(big, TOP)
    for _ in range(240):
        world.step(DT)
    for _ in range(120):
        world.step(DT, 20)
    np.testing.assert_allclose(joint.force, [0, 0, 1000 * G], atol=0.01 * 1000 * G)
    np.testing.assert_allclose(block.positions()[TOP], big.positions()[BOTTOM], atol=1e-5)
    assert np.abs(block.velocities()).max() < 1e-2
    joint.release()
    block.set_linear_damping(0.0)
    assert not joint.is_attached
    start = block.center_of_mass()[2]
    for _ in range(30):
        world.step(DT, 20)
    assert start - block.center_of_mass()[2] == pytest.approx(G / 8, rel=5e-3)


def test_a_frame_feels_what_hangs_from_what_it_holds(soft):
    world, big, _, block, _ = soft
    frame = world.add_frame()
    hold = big.attach(np.arange(27), frame, two_way=True)
    block.set_gravity_scale(1.0)
    block.set_linear_damping(2.0)
    block.teleport((0, 0, -1))
    block.attach_to(big, TOP)
    for _ in range(240):
        world.step(DT)
    np.testing.assert_allclose(hold.force, [0, 0, -1000 * G], atol=0.01 * 1000 * G)
    hold.release()


def test_what_is_joined_does_not_fight_contact(soft):
    """Where a body is held on another that it touches nothing moves; free, contact moves them apart."""
    world, big, small, block, _ = soft
    small.attach_to(big, UNDER)
    block.teleport((0, 0, -1))
    block.attach_to(big, TOP)
    before = [body.positions() for body in world.bodies]
    for _ in range(30):
        world.step(DT)
    for body, rows in zip(world.bodies, before, strict=True):
        np.testing.assert_allclose(body.positions(), rows, atol=1e-5)
    for joint in list(world.joints):
        joint.release()
    for _ in range(30):
        world.step(DT)
    assert small.center_of_mass()[2] > ABOVE[2] + 1e-3


def test_joined_bodies_touch_where_they_are_not_joined(soft):
    """The far end of a lid on a hinge comes down on the block and does not go through."""
    world, big, small, *_ = soft
    hinge = UNDER[SMALL.vertices[UNDER, 0] < -0.3]
    small.attach_to(big, hinge)
    big.pin(BOTTOM)
    for body in (big, small):
        body.set_material(JELLY)
    small.set_gravity_scale(1.0)
    small.apply_impulse((0.0, 0.0, 150.0), np.flatnonzero(SMALL.vertices[:, 0] > 0.3))
    highest = 0.0
    for _ in range(120):
        world.step(DT)
        far = small.positions()[UNDER][SMALL.vertices[UNDER, 0] > 0.3]
        highest = max(highest, far[:, 2].min() - big.positions()[TOP, 2].max())
    assert highest > 0.03
    deepest = (far[:, 2] - big.positions()[TOP, 2].min()).min()
    assert -0.02 < deepest < 0.05


@pytest.mark.parametrize(("heavy", "light"), [(0, 1), (1, 0)])
@pytest.mark.parametrize("stiff", [False, True])
def test_a_thousand_times_the_mass_blows_nothing_up(joined, heavy, light, stiff):
    world, *bodies = joined
    bodies[light].set_material(Material(2e5, 0.3, 3.0, 0.05) if stiff else LIGHT)
    ratio = bodies[heavy].masses.sum() / bodies[light].masses.sum()
    assert ratio > 60
    bodies[light].set_velocity((5.0, 3.0, 8.0), (0.0, 5.0, 0.0))
    bodies[1].attach_to(bodies[0], UNDER)
    bodies[heavy].set_gravity_scale(0.1)
    before = sum(body.kinetic_energy() for body in bodies)
    for step in range(60):
        world.step(DT)
        fallen = bodies[heavy].masses.sum() * (0.1 * G * (step + 1) * DT) ** 2 / 2
        assert sum(body.kinetic_energy() for body in bodies) < 1.05 * (before + fallen) + 1.0
    assert not any(body.is_frozen for body in bodies)
    assert np.linalg.norm(bodies[light].center_of_mass() - bodies[heavy].center_of_mass()) < 1.2


def test_what_is_put_elsewhere_is_drawn_together_gently(joined):
    """One particle of a body of 210 kg is joined, without weight or wind."""
    world, big, small, *_ = joined
    big.set_material(JELLY)
    small.set_material(JELLY)
    small.attach_to(big, UNDER[:1])
    tets, weights = places_in(BIG, small.positions()[UNDER[:1]].astype(float))
    small.teleport((0.3, 0.3, 1.2))
    stretch = 0.0
    for _ in range(600):
        world.step(DT)
        for body in (big, small):
            stretch = max(stretch, np.linalg.norm(body.deformations(), ord=2, axis=(1, 2)).max())
    assert stretch < 2.0
    place = weights[0] @ big.positions()[tets[0]]
    assert np.linalg.norm(small.positions()[UNDER[0]] - place) < 0.01


REFUSED = {
    "no body": (lambda a, b: a.attach_to(None, [0]), "other must be another body of the same world"),
    "itself": (lambda a, b: a.attach_to(a, [0]), "other must be another body"),
    "no particles": (lambda a, b: a.attach_to(b, []), "particles is empty"),
    "a vertex too high": (lambda a, b: a.attach_to(b, [27]), "names vertex 27"),
    "half a vertex": (lambda a, b: a.attach_to(b, [0.5]), "list of vertex numbers"),
    "onto nothing": (lambda a, b: a.attach_to(b, [0], onto=[]), "onto is empty"),
    "onto too few": (lambda a, b: a.attach_to(b, [0, 1], onto=[2]), "onto has 1 vertices for 2"),
    "onto a vertex too high": (lambda a, b: a.attach_to(b, [0], onto=[99]), "onto names vertex 99"),
    "twice": (lambda a, b: a.attach_to(b, [1, 1], onto=[2, 3]), "1 vertices twice"),
    "too far": (lambda a, b: a.attach_to(b, [0]), r"vertex 0 of body 3 is too far from body 0, 49[.\d]* m"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_refused_call_changes_nothing(soft, name):
    world, big, small, _, far = soft
    small.attach_to(big, UNDER)
    call, message = REFUSED[name]
    before = state_of(world)
    with pytest.raises(OptionError, match=message):
        call(far, big)
    assert state_of(world) == before


def test_a_full_world_refuses_and_changes_nothing(soft):
    world, big, small, block, _ = soft
    joints = [small.attach_to(big, UNDER[:1]) for _ in range(MOST_JOINTS)]
    block.teleport((0, 0, -1))
    before = state_of(world)
    with pytest.raises(StateError, match=f"{MOST_JOINTS} joints"):
        block.attach_to(big, TOP)
    assert state_of(world) == before
    joints[20].release()
    assert block.attach_to(big, TOP)._number == 20
    world.step(DT)
    assert not small.is_frozen


def test_a_world_without_joints_says_what_to_do():
    world = bare_world(floor=None, schedule="flat")
    a = world.add_body(BIG, JELLY)
    b = world.add_body(BIG, JELLY, position=(0, 0, -1))
    with pytest.raises(StateError, match="not built"):
        b.attach_to(a, TOP)
    world.build()
    with pytest.raises(StateError, match=r"'flat' .* joints.*'per_body'"):
        b.attach_to(a, TOP)
    other = bare_world(floor=None)
    with pytest.raises(OptionError, match="of the same world"):
        other.add_body(BIG, JELLY).attach_to(a, TOP)
