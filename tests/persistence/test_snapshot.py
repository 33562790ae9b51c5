"""Snapshots: what comes back, bit by bit; what is refused, with nothing changed."""

import gc
import json
import warnings

import numpy as np
import pytest
from random_play import DT, SUBSTEPS, make_world, play

from taichi_soft import (
    BoxShape,
    FrozenBodyWarning,
    Material,
    OptionError,
    Plasticity,
    SnapshotError,
    SoftBodyAsset,
    SphereShape,
    SpringMaterial,
    StateError,
    box,
    rope,
)
from taichi_soft.core.container import seal, unseal
from taichi_soft.persistence.snapshot import MARK, VERSION, row_counts
from taichi_soft.world.bare import bare_world
from taichi_soft.world.world import context_of_world


def middle():
    """Return a world in the middle of a game, and the mesh of its bodies."""
    world, cube = make_world()
    play(world, cube, 60, seed=5)
    return world, cube


@pytest.fixture(scope="module")
def twin():
    """Return observations of a world that no longer exists.

    The observations are a hash, a snapshot taken later, its readings, and the hashes of the following steps.
    """
    world, cube = middle()
    name = world.state_hash()
    play(world, cube, 15, seed=7)
    return name, world.snapshot(), readings(world), play(world, cube, 20, seed=8)


@pytest.fixture(scope="module")
def living(twin):
    """Return a second world, made after the end of `twin`'s world, whose kernels it reuses."""
    return middle()


@pytest.fixture
def played(living):
    """Return a world in the middle of a game, which is restored after the test."""
    world, cube = living
    data = world.snapshot()
    yield world, cube
    world.restore(data)


@pytest.fixture(scope="module")
def small():
    """Make a world that contains only two cubes."""
    world = bare_world(retries=0)  # with retries, no body would freeze
    for x in (0.0, 2.0):
        world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0, 20.0), position=(x, 0, 1.5))
    world.build()
    return world


def readings(world):
    """Return the values that a user reads."""
    bodies = world.bodies
    return [
        *(body.positions().tobytes() + body.velocities().tobytes() for body in bodies),
        *((body.index, body.is_frozen, body.is_asleep, body.pinned.tolist()) for body in bodies),
        *(each.position.tolist() for each in world.colliders),
        *((each.impulse.tolist(), each.angular_impulse.tolist()) for each in world.colliders),
        *(grab.force.tolist() for grab in world.grabs),
        *(joint.force.tolist() for joint in world.joints),
        *((motor.effort, motor.measured_speed, motor.speed, motor.limit) for motor in world.motors),
        *(a.force.tolist() for body in bodies for a in body.attachments if a.two_way),
        *(world.read_positions(body, 0.25).tobytes() for body in bodies),
        (world.step_count, world.time, world.last_dt),
    ]  # fmt: skip


def test_everything_that_can_be_read_comes_back(played):
    world, cube = played
    data, before, name = world.snapshot(), readings(world), world.state_hash()
    play(world, cube, 15, seed=6)
    assert readings(world) != before
    world.restore(data)
    assert readings(world) == before
    assert world.state_hash() == name
    assert world.snapshot() == data


def test_a_world_with_the_same_history_has_the_same_hash(played, twin):
    assert played[0].state_hash() == twin[0]


def test_another_world_goes_on_from_a_snapshot(played, twin):
    world, cube = played
    _, data, seen, hashes = twin
    world.restore(data)
    assert readings(world) == seen
    assert play(world, cube, 20, seed=8) == hashes


def test_the_hash_changes_with_the_state(small):
    names = {small.state_hash()}
    small.step(DT, SUBSTEPS)
    names.add(small.state_hash())
    body = small.bodies[1]
    small.bodies[0].apply_impulse((0, 0, 1e-2), [7])
    names.add(small.state_hash())
    body.pin([3])
    names.add(small.state_hash())
    body.set_gravity_scale(1.001)
    names.add(small.state_hash())
    assert len(names) == 5
    assert all(len(name) == 16 and int(name, 16) >= 0 for name in names)


def tidy(world):
    """Leave one body, free, and the first colliders."""
    for grab in world.grabs:
        grab.release()
    for body in world.bodies[1:]:
        world.despawn(body)
    for attachment in list(world.bodies[0].attachments):
        attachment.release()
    for collider in world.colliders[3:]:
        collider.remove()


def test_handles_of_what_the_state_has_live_and_others_die(played):
    world, cube = played
    tidy(world)
    first = world.bodies[0]
    frame = world.add_frame()
    attachment = first.attach([0, 1], frame)
    grab = first.grab(0)
    data = world.snapshot()
    attachment.release()
    grab.release()
    world.despawn(first)
    later = world.spawn(cube, position=(3, 0, 2))
    sphere = world.colliders[0]
    sphere.remove()
    late_frame = world.add_frame()
    late_grab = later.grab(0)
    late_hold = later.attach([3], late_frame)
    world.restore(data)
    assert first.is_alive
    assert first is world.bodies[0]
    assert grab.is_held
    assert attachment.is_attached
    assert sphere.is_alive
    assert sphere in world.colliders
    grab.move((0, 0, 2))
    attachment.release()
    assert not later.is_alive
    with pytest.raises(StateError, match="removed"):
        later.positions()
    with pytest.raises(StateError, match="restored"):
        late_frame.move_to((0, 0, 0))
    assert not late_frame.is_alive
    with pytest.raises(StateError):
        late_grab.move((0, 0, 0))
    assert not late_hold.is_attached
    world.step(DT, SUBSTEPS)


def test_a_new_handle_where_nobody_holds_one(played):
    world, cube = played
    tidy(world)
    body = world.spawn(cube, position=(3, 0, 2))
    slot, place = body.index, body.positions()
    data = world.snapshot()
    world.despawn(body)
    del body
    world.restore(data)
    found = next(each for each in world.bodies if each.index == slot)
    assert (found.positions() == place).all()
    world.despawn(found)


def test_what_holds_a_body_has_handles_after_restore(played):
    world, cube = played
    tidy(world)
    body, other = (world.spawn(cube, position=(x, 0, 2)) for x in (3.0, 3.4))
    others = [len(each) for each in (world.grabs, world.joints, world.frames)]
    hand, joint, frame = body.grab(0), body.attach_to(other, [0], onto=[0]), world.add_frame()
    other.attach([1], frame)
    slots, data = (body.index, other.index), world.snapshot()
    for each in (hand, joint, *other.attachments):
        each.release()
    frame.remove()
    del hand, joint, frame, body, other
    world.restore(data)
    body, other = (next(each for each in world.bodies if each.index == slot) for slot in slots)
    assert body.is_held
    assert [len(each) for each in (world.grabs, world.joints, world.frames)] == [n + 1 for n in others]
    (hand,) = (each for each in world.grabs if each.body is body)
    (joint,) = (each for each in world.joints if each.body is body)
    hand.release()
    joint.release()
    assert not body.is_held
    (hold,) = other.attachments
    assert hold.frame in world.frames
    hold.release()
    hold.frame.remove()
    assert [len(each) for each in (world.grabs, world.joints, world.frames)] == others
    for each in (body, other):
        world.despawn(each)


def test_a_frozen_body_and_its_failure_come_back(small):
    body = small.bodies[0]
    sound, name = small.snapshot(), small.state_hash()
    body.set_motion(body.positions(), np.full((8, 3), 9e3) * np.where(np.arange(8) % 2, 1, -1)[:, None])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)
        for _ in range(100):
            small.step(DT, 1)
    assert body.is_frozen
    failure, frozen = body.failure, small.snapshot()
    assert failure.tetrahedron is not None
    small.restore(sound)
    assert not body.is_frozen
    assert body.failure is None
    assert small.state_hash() == name
    small.step(DT, SUBSTEPS)
    small.restore(frozen)
    assert body.is_frozen
    assert body.failure == failure


def test_materials_that_were_set_come_back(small):
    body, other = small.bodies
    before = body.material
    body.set_material(Material(3e5, 0.1, 800.0, 5.0))
    mass = body.masses.sum()
    data = small.snapshot()
    small.step(DT, SUBSTEPS)
    after = small.state_hash()
    body.set_material(before)
    other.set_damping(1.0)
    small.restore(data)
    assert (body.material.young, body.material.density) == (3e5, 800.0)
    assert body.masses.sum() == mass
    assert other.material.damping == 20.0
    small.step(DT, SUBSTEPS)
    assert small.state_hash() == after
    assert np.isclose(mass, 800.0)


@pytest.mark.soak
@pytest.mark.parametrize("integrator", ["implicit_euler", "lazy_leapfrog"])
def test_other_integrators_go_on_the_same(integrator):
    world = bare_world(integrator=integrator)
    world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), position=(0, 0, 0.52))
    world.build()
    for _ in range(10):
        world.step(DT, 6)
    data = world.snapshot()

    def run():
        found = []
        for _ in range(10):
            world.step(DT, 6)
            found.append(world.state_hash())
        return found

    expected = run()
    world.restore(data)
    assert run() == expected


def every_part(data):
    """One position in each part of a snapshot: mark, version, lengths, notes, words, memory and the rest."""
    parts = unseal(data, MARK, VERSION, "snapshot")
    at = [0, 9, 13, 20, 30]
    begin = 16 + 8 * len(parts)
    for part in parts:
        at += [begin, begin + len(part) // 2, begin + len(part) - 1]
        begin += len(part)
    return [*at, len(data) - 16, len(data) - 1]


def refused(world, data, match=None):
    """Assert that a restore raises SnapshotError and changes nothing."""
    name, before = world.state_hash(), world.snapshot()
    with pytest.raises(SnapshotError, match=match):
        world.restore(data)
    assert world.state_hash() == name
    assert world.snapshot() == before


def test_a_damaged_byte_anywhere_is_refused(small):
    data = small.snapshot()
    for at in every_part(data):
        for bit in (0, 7):
            bad = bytearray(data)
            bad[at] ^= 1 << bit
            refused(small, bytes(bad))


def test_what_is_cut_off_or_longer_is_refused(small):
    data = small.snapshot()
    for length in (0, 1, 15, 31, 100, len(data) // 2, len(data) - 1):
        refused(small, data[:length])
    refused(small, data + b"\0")
    with pytest.raises(OptionError, match="must be bytes"):
        small.restore("snapshot")


def other_worlds():
    jelly, firm = Material(1e5, 0.2, 1000.0, 20.0), Material(2e5, 0.2, 1000.0, 20.0)
    mesh = box(cells=(1, 1, 1))
    yield "another count", [(mesh, jelly, {})], {}, "bodies"
    yield "another material", [(mesh, jelly, {}), (mesh, firm, {})], {}, "body 1"
    yield "another mesh", [(box((1, 1, 1.5), cells=(1, 1, 1)), jelly, {}), (mesh, jelly, {})], {}, "body 0"
    yield "another law", [(mesh, jelly, {}), (mesh, jelly, {"law": "face"})], {}, "body 1"
    yield "another floor", [(mesh, jelly, {})] * 2, {"floor": -1.0}, "floor"
    yield "another integrator", [(mesh, jelly, {})] * 2, {"integrator": "lazy_leapfrog"}, "integrator"


@pytest.mark.parametrize(("bodies", "options", "what"), [case[1:] for case in other_worlds()])
def test_the_snapshot_of_another_world_is_refused_with_what_differs(small, bodies, options, what):
    world = bare_world(**options)
    for i, (mesh, material, more) in enumerate(bodies):
        world.add_body(mesh, material, position=(2 * i, 0, 1.5), **more)
    world.build()
    refused(small, world.snapshot(), what)


def test_a_snapshot_of_a_time_when_worlds_had_fewer_slices_is_refused(small):
    structure, *others = unseal(small.snapshot(), MARK, VERSION, "snapshot")
    built_of = json.loads(bytes(structure))
    built_of["slices"].remove("motors")
    older = [json.dumps(built_of).encode(), *(bytes(each) for each in others)]
    refused(small, seal(MARK, VERSION, older), "slices")


def forged(world, data, change):
    """Return a snapshot with made-up contents and a correct checksum."""
    structure, notes, words, memory = unseal(data, MARK, VERSION, "snapshot")
    content, rows = json.loads(bytes(notes)), np.frombuffer(words, "<i4").copy()
    change(content, rows, world)
    return seal(
        MARK, VERSION, [bytes(structure), json.dumps(content).encode(), rows.tobytes(), bytes(memory)]
    )


def set_note(*path, to):
    def change(content, rows, world):
        for key in path[:-1]:
            content = content[key]
        content[path[-1]] = to

    return change


def set_number(name, to, row=0, column=0):
    """Change a number of a field in a snapshot of `small`."""

    def change(content, rows, world):
        context = context_of_world(world)
        state = context.built.state
        field = next(field for each, _, field in state.fields if each == name)
        counts, start = row_counts(context, content["slices"]), 0
        for group, members in state.kept.items():
            width = sum(size for *_, size in members)
            for each, first, _ in members:
                if each is field:
                    at = start + row * width + first + column
                    rows[at] = np.float32(to).view(np.int32) if isinstance(to, float) else to
            start += counts[group] * width

    return change


@pytest.mark.parametrize(
    "change",
    [
        set_note("bodies", to=[]),
        set_note("bodies", 0, to=None),
        set_note("bodies", 0, to=[1, 2]),
        set_note("bodies", 0, 3, to={"kind": "Material"}),
        set_note("bodies", 0, 3, to={"kind": "os.system"}),
        set_note("bodies", 0, 4, to=[8, 5, "none"]),
        set_note("slices", "attachments", to=[[9, 0, 0, False, [0]]]),
        set_note("slices", "tears", to=[[0]]),
        set_note("steps", to="many"),
        set_note("slices", "grabs", to=[[9, 99, 0, [0, 0, 0]]]),
        set_note("slices", "grabs", to=[[9, 0, 0, [0, 0, 0]]]),
        set_note("slices", "frames", to=[1, 2, 3]),
        set_note("slices", "frames", to=[[9, [1e30] * 12, [0.0] * 12]]),
        set_note("slices", "colliders", to=[[9, True, "none", None, 0, [0, 0, 0, 1, 1], [], None]]),
        set_note("time", to=np.nan),
        set_note("last_dt", to=np.inf),
        set_note("handles", to=1),
        set_note("bodies", 1, 0, to=1),
        set_number("particle_position", np.nan),
        set_number("prev_velocity", np.nan),
        set_number("particle_position", 1e30),
        set_number("particle_aim", 77),
        set_number("body_status", 99),
        set_number("body_status", 4),
        set_number("body_velocity_lag", np.nan),
        set_number("wind", np.nan, column=3),
        set_number("grabs.body", 99),
    ],
)
def test_what_is_whole_but_makes_no_sense_is_refused(small, change):
    refused(small, forged(small, small.snapshot(), change))


@pytest.fixture(scope="module")
def held():
    """A world with all that notes tell of: colliders, a frame, a grab, an attachment, a joint, a motor."""
    world = bare_world(collider_room=2)
    mesh = box(cells=(1, 1, 1))
    a, b = (world.add_body(mesh, Material(1e5, 0.2, 1000.0), position=(0, 0, z)) for z in (0.6, 1.7))
    world.add_collider(BoxShape((1, 1, 1)), position=(3, 0, 0.5)).set_velocity((0.1, 0, 0))
    moved = world.add_collider(SphereShape(0.5), position=(-3, 0, 0.5), restitution=0.2)
    world.build()
    moved.move_to((-3, 0, 0.6))
    a.set_material(Material(2e5, 0.2, 1000.0))
    return (
        world,
        a.attach([0], world.add_frame((0, 0, 2)), two_way=True),
        a.grab(0),
        a.attach_to(b, [4], onto=[0]),
        world.add_motor(b, [0, 1, 2, 4], (0, 0, 1), speed=1.0, max_torque=5.0),
    )


def leaves(value, path=()):
    """Return the paths of the numbers, texts and lists in the notes."""
    keys = value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    yield from (leaf for key in keys for leaf in leaves(value[key], (*path, key)))
    if path and not isinstance(value, dict):
        yield path


def test_whatever_a_note_says_it_is_refused_whole_or_restored_whole(held):
    world, data = held[0], held[0].snapshot()
    content = json.loads(bytes(unseal(data, MARK, VERSION, "snapshot")[1]))
    count = 0
    for path in leaves(content):
        for bad in (np.nan, 1e30, 2**70, None):
            made_up = forged(world, data, set_note(*path, to=bad))
            try:
                world.restore(made_up)
            except SnapshotError:
                count += 1
            else:
                world.snapshot()
                world.restore(data)
            assert world.snapshot() == data, (path, bad)
    assert count > 500


def test_it_is_no_call_before_build():
    world = bare_world()
    for call in (world.snapshot, world.state_hash, lambda: world.restore(b"")):
        with pytest.raises(StateError, match="build"):
            call()


@pytest.mark.soak
def test_a_rope_goes_on_the_same():
    world = bare_world()
    world.add_body(
        rope(1.0, 8, mass=0.4), SpringMaterial(500.0, 0.2), law="springs", position=(0, 0, 2), pinned=[0]
    )
    world.build()
    data = world.snapshot()
    world.step(DT, 20)
    name = world.state_hash()
    world.restore(data)
    world.step(DT, 20)
    assert world.state_hash() == name


def test_an_asset_made_again_is_the_same():
    """A player who joins late builds the world from equal numbers, not from the same objects."""
    names = []
    for number in (1000.0, 1000):
        world = bare_world()
        asset = SoftBodyAsset(box(cells=(1, 1, 1)), Material(1e5, 0.2, number, 20))
        world.reserve(asset, 1)
        world.build()
        world.spawn(asset, position=(0, 0, 1))
        names.append(world.snapshot())
    world.restore(names[0])


@pytest.fixture(scope="module")
def bendable():
    """A world of one body that can be bent for good and cut, and an empty slot."""
    asset = SoftBodyAsset(
        box(cells=(2, 2, 2)),
        Material(1e5, 0.2, 1000.0, 20.0),
        plasticity=Plasticity(yield_strain=0.02),
        spare_vertices=30,
    )
    world = bare_world()
    world.reserve(asset, 2)
    world.build()
    world.spawn(asset, position=(0, 0, 0.6))
    for _ in range(30):
        world.step(DT, SUBSTEPS)
    return world


@pytest.mark.guard
@pytest.mark.soak
def test_rest_shapes_come_back(bendable):
    body = bendable.bodies[0]
    data, bent, before = bendable.snapshot(), body.plastic_strains(), bendable.state_hash()
    assert bent.max() > 0.0

    def throw():
        body.apply_impulse((0, 0, -4000.0))
        for _ in range(10):
            bendable.step(DT, SUBSTEPS)
        return bendable.state_hash()

    thrown = throw()
    assert (body.plastic_strains() != bent).any()
    bendable.restore(data)
    assert bendable.state_hash() == before
    assert (body.plastic_strains() == bent).all()
    assert throw() == thrown
    bendable.restore(data)


def test_what_a_larger_world_held_before_is_not_in_the_snapshots_of_the_next():
    """The next world reuses the fields of the larger one."""
    for cells in (4, 1):
        world = bare_world(floor=None)
        mesh = box(cells=(cells,) * 3)
        bodies = [world.add_body(mesh, Material(1e5, 0.2, 1000.0), position=(x, 0, 0)) for x in (0, 3)]
        world.build()
        bodies[cells // 4].grab(0 if cells == 1 else len(mesh.vertices) - 1)
        world.step(DT)
        world.restore(world.snapshot())
        del bodies, world
        gc.collect()
