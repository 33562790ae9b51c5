"""Bodies that come and go at run time, from pools of slots; and their handles, alive and dead."""

import heapq
import inspect

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    Body,
    Device,
    FrozenBodyWarning,
    Material,
    OptionError,
    SoftBodyAsset,
    StateError,
    box,
    sphere,
)
from taichi_soft.core.taichi_workarounds.known_kernels import FirstLaunches
from taichi_soft.core.types import Schedule
from taichi_soft.solver.schedules import make_launch
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

DT = 1 / 60
JELLY = Material(1e5, 0.2, 1000.0, 20.0)
MESH, BALL = box(cells=(2, 2, 2)), sphere(0.5, 2)
TILT = (0.0, np.sin(0.2), 0.0, np.cos(0.2))
WAY = {"position": (3.0, 1.0, 0.75), "rotation": TILT, "velocity": (0.5, 1.0, -2.0)}
NOWHERE = {"position": (0.0, -50.0, 0.55), "velocity": (1.0, 0.0, 0.0)}

MODES = {
    "per_body": {"schedule": "per_body"},
    "flat": {"schedule": "flat"},
    "gpu": {"schedule": "flat"},
    "implicit": {"integrator": "implicit_euler"},
    "contact": {"soft_contact": True},
}


def cube(**options):
    return SoftBodyAsset(MESH, JELLY, **options)


def ball():
    return SoftBodyAsset(BALL, JELLY, law="face", flips="recover")


def build(world, mode="per_body"):
    world.build()
    if mode == "gpu":  # one launch per substep, on the CPU
        pretended, built = Device("cuda", 1, "pretended"), world._built
        built.launch = make_launch(Schedule.FLAT, built.state, built.program, built.scene, pretended)
    return world


def bits(body):
    between = body._context.built.positions(body, 0.3, None)
    rows = (body.positions(), body.velocities(), between)
    return b"".join(row.tobytes() for row in rows)


def broken(world, asset):
    """Make a body fail by moving it out of range."""
    body = world.spawn(asset, **NOWHERE)
    rows = np.ones((body.vertex_count, 3))
    body.set_motion(9.9999e6 * rows, 1.9e4 * rows)
    with pytest.warns(FrozenBodyWarning, match=f"body {body.index} went"):
        world.step(DT, 4)
    assert body.is_frozen
    return body


def told_by_a_world_of_their_own(mode):
    """Bits of a resident and of a body that is pinned at a corner, from the start to the first contact on."""
    world = bare_world(**MODES[mode])
    resident = world.add_body(BALL, JELLY, position=(0, 0, 0.8))
    pinned = world.add_body(MESH, JELLY, pinned=[3], **WAY)
    build(world, mode)
    told = [(bits(resident), bits(pinned))]
    for _ in range(12):
        world.step(DT, 4)
        told.append((bits(resident), bits(pinned)))
    assert pinned.positions()[:, 2].min() < 0.01
    return told


@pytest.mark.guard
@pytest.mark.parametrize("mode", MODES)
def test_a_body_that_comes_later_moves_as_one_of_the_start_and_leaves_no_trace_on_others(mode):
    """Bit for bit: in a slot where one lay on the floor before, and where one broke."""
    told = told_by_a_world_of_their_own(mode)
    world = bare_world(**MODES[mode])
    kind, other = cube(pinned=[3]), SoftBodyAsset(BALL, JELLY)
    world.reserve(kind, 2)
    world.reserve(other, 2)
    resident = world.spawn(other, position=(0, 0, 0.8))
    build(world, mode)
    guests = [world.spawn(kind, **NOWHERE)]
    world.step(DT, 4)
    guests.append(broken(world, kind))
    world.step(DT, 4)
    world.step(DT, 4)
    assert bits(resident) == told[4][0]
    for guest in guests:
        world.despawn(guest)
    first = world.spawn(kind, **WAY)
    second = first if mode == "contact" else world.spawn(kind, **WAY)  # they would not lie in each other
    assert (first.index, second.index) == (0, int(mode != "contact"))
    assert first.solve_residual is None  # of the one before
    for step in range(8):
        assert bits(first) == bits(second) == told[step][1], step
        assert bits(resident) == told[step + 4][0], step
        if step == 5:
            world.spawn(other, **NOWHERE)
        world.step(DT, 4)
    assert (first.solve_residual is None) == (mode != "implicit")
    assert not first.is_frozen
    assert second.failure is None


@pytest.fixture(scope="module")
def play():
    """A built world with two pools of three, in which all bodies fall freely."""
    world = bare_world(floor=None)
    kinds = (cube(), ball())
    for kind in kinds:
        world.reserve(kind, 3)
    build(world)
    return world, kinds


def test_a_world_without_bodies_goes_on(empty):
    world, _ = empty
    before = world.time
    world.step(DT)
    assert world.bodies == ()
    assert world.time == pytest.approx(before + DT)


READABLE = {"asset", "index", "is_alive", "is_frozen", "mesh", "material", "vertex_count", "tets", "surface"}
READABLE |= {
    "masses",
    "is_cut",
    "topology_version",
    "vertex_origins",
    "tet_origins",
    "render_meshes",
    "friction",
    "level",
}
ARGUMENTS = {"set_motion": (np.zeros_like(MESH.vertices), np.zeros_like(MESH.vertices))}
ARGUMENTS |= {"watch_stress": (1e4,), "watch_tearing": (1e4,), "cut": ()}
UP = (0.0, 0.0, 1.0)
ARGUMENTS |= {name: (UP,) for name in ("apply_force", "apply_impulse", "set_velocity", "teleport")}
ARGUMENTS |= {
    "apply_impulse_at_point": (UP, (9.0, 0.0, 0.0), 1.0),
    "attach": ([0], None),
    "attach_to": (None, [0]),
}
ARGUMENTS |= {"grab": (0, (1.0, 0.0, 0.0)), "pin": ([0],), "set_targets": ([0], [(9.0, 0.0, 0.0)])}
ARGUMENTS |= {
    name: (1.0,) for name in ("set_damping", "set_friction", "set_gravity_scale", "set_linear_damping")
}
ARGUMENTS |= {"force_across": ((9.0, 0.0, 0.0), UP)}
ARGUMENTS |= {"set_material": (JELLY,), "set_sheltered": (True,), "set_level": (0,)}
ARGUMENTS |= {"set_enabled": (True,), "set_filter": (1, 1)}


def asked(body, name):
    value = getattr(body, name)
    if not callable(value):
        return value
    needed = [p for p in inspect.signature(value).parameters.values() if p.default is p.empty]
    assert name in ARGUMENTS or not needed, f"{name} needs a line in ARGUMENTS"
    return value(*ARGUMENTS.get(name, ()))


@pytest.mark.parametrize("name", [name for name in dir(Body) if not name.startswith("_")])
def test_a_dead_handle_says_so_and_what_it_was_can_still_be_read(empty, name):
    world, (kind, _) = empty
    world.spawn(kind)
    body = world.spawn(kind, position=(5, 0, 0))
    assert body.is_alive
    world.despawn(body)
    again = world.spawn(kind, position=(9, 0, 0))
    assert (again.index, again.is_alive, body.is_alive) == (1, True, False)
    before = bits(again)
    if name in READABLE:
        asked(body, name)
    else:
        with pytest.raises(StateError, match=rf"body 1 .*despawn.*step {world.step_count}"):
            asked(body, name)
    assert repr(body).endswith("removed)")
    assert repr(again).endswith("active)")
    assert bits(again) == before


def test_bodies_can_come_and_go_before_the_world_is_built():
    world, kind = bare_world(floor=None), cube()
    world.reserve(kind, 3)
    first, second = (world.spawn(kind, position=(x, 0, 0)) for x in (1, 5))
    world.despawn(first)
    with pytest.raises(StateError, match=r"body 0.*despawn.*step 0"):
        first.positions()
    build(world)
    assert world.bodies == (second,)
    third = world.spawn(kind, position=(9, 0, 0))
    assert world.bodies == (third, second)
    assert [body.center_of_mass()[0] for body in world.bodies] == pytest.approx([9, 5], abs=1e-6)


def test_a_body_that_was_added_can_go_and_come_again():
    world = bare_world(floor=None)
    bodies = [world.add_body(MESH, JELLY, position=(x, 0, 0)) for x in (0, 5)]
    build(world)
    kind = bodies[0].asset
    assert bodies[1].asset is kind
    with pytest.raises(StateError, match="is full: 2 of 2"):
        world.spawn(kind)
    world.despawn(bodies[0])
    assert world.spawn(kind, position=(7, 0, 0)).center_of_mass() == pytest.approx([7, 0, 0], abs=1e-6)


def test_a_spinning_body_has_the_momentum_and_the_spin_that_were_asked_for(empty):
    """P = m v and L = I omega about the centre of mass, with the moment of inertia from the masses."""
    world, (_, kind) = empty
    spin, speed = np.array([1.0, -2.0, 0.5]), np.array([3.0, 0.0, -1.0])
    body = world.spawn(kind, position=(4, 5, 6), rotation=TILT, velocity=speed, angular_velocity=spin)
    m, x = body.masses, body.positions().astype(float)
    arm = x - m @ x / m.sum()
    inertia = np.einsum(
        "n,nij->ij", m, (arm**2).sum(axis=1)[:, None, None] * np.eye(3) - np.einsum("ni,nj->nij", arm, arm)
    )
    about = np.cross(arm, m[:, None] * body.velocities()).sum(axis=0)
    np.testing.assert_allclose(body.momentum(), m.sum() * speed, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(about, inertia @ spin, rtol=1e-5, atol=1e-4)


def test_a_body_that_is_put_on_the_floor_touches_it_however_it_is_turned():
    """Added or spawned, from a mesh far from its origin, by the points of its hull; z is the gap below it."""
    world, rng = bare_world(floor=1.0, soft_contact=True), np.random.default_rng(5)
    off_centre = SoftBodyAsset(MESH.translated((3.0, -2.0, 7.0)), JELLY)
    hulled = SoftBodyAsset(BALL, JELLY, skin=trimesh.creation.icosphere(subdivisions=3, radius=0.6), hull=100)
    for asset in (off_centre, hulled):
        world.reserve(asset, 3)
    placed = []
    for built in (False, True):
        if built:
            build(world)
        for place, asset in enumerate((off_centre, hulled)):
            turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            turn *= np.linalg.det(turn)
            where = {"position": (5.0 * place, 9.0 * built, 0.25 * place), "rotation": turn, "on_floor": True}
            bodies = [world.spawn(asset, **where)]
            if not built:
                bodies.append(
                    world.add_body(asset, **where | {"position": (5.0 * place, -9.0, 0.25 * place)})
                )
            placed += [(body, place, turn) for body in bodies]
    for body, place, turn in placed:
        x = body.positions().astype(float)
        if body.asset is hulled:
            hull = hulled.bound_hull
            touching = (hull.weights[:, :, None] * x[hull.vertices]).sum(axis=1)
            assert np.abs(np.linalg.norm(touching - x.mean(axis=0), axis=1) - 0.6).max() < 0.01
        else:
            touching = x
        assert touching[:, 2].min() == pytest.approx(1.0 + 0.25 * place, abs=1e-5)
        np.testing.assert_allclose(
            x - x.mean(axis=0), (body.mesh.vertices - body.mesh.vertices.mean(axis=0)) @ turn.T, atol=1e-5
        )
        origin = x.mean(axis=0) - turn @ body.mesh.vertices.mean(axis=0)
        assert origin[0] == pytest.approx(5.0 * place, abs=1e-5)


def test_pinned_vertices_stay_where_a_moving_body_was_put(empty):
    world = bare_world(floor=None)
    kind = cube(pinned=[0, 1])
    world.reserve(kind, 1)
    build(world)
    body = world.spawn(kind, velocity=(1, 2, 0), angular_velocity=(0, 1, 0))
    for _ in range(5):
        world.step(DT)
    np.testing.assert_array_equal(body.positions()[:2], MESH.vertices[:2].astype(np.float32))
    assert body.center_of_mass()[1] > 0.01


def test_the_number_of_substeps_does_not_depend_on_who_lives(empty):
    world, kinds = empty
    needed = max(int(np.ceil(DT / kind.stable_step.recommended)) for kind in kinds)
    counts = [world.stable_substeps(DT)]
    for kind in kinds:
        world.spawn(kind)
        counts.append(world.stable_substeps(DT))
    assert counts == [needed] * 3


@pytest.mark.guard
def test_nothing_is_compiled_when_the_first_body_comes(monkeypatch):
    compiled = []
    prepare = FirstLaunches._prepare  # of a kernel, from its source or from what an earlier process kept

    def noted(launches, kernel, *rest):
        compiled.append(kernel.func.__name__)
        prepare(launches, kernel, *rest)

    monkeypatch.setattr(FirstLaunches, "_prepare", noted)
    monkeypatch.setattr("taichi_soft.bodies.fields._free", [])  # none that another test has used
    world, kinds = bare_world(), (cube(), SoftBodyAsset(BALL, JELLY))
    for kind in kinds:
        world.reserve(kind, 70)
    resident = world.spawn(kinds[0], position=(0, 0, 3))
    build(world)
    assert "spawn_body" in compiled
    world.step(DT)
    resident.positions()
    compiled.clear()
    guests = [
        world.spawn(kind, position=(5, 0, 3), rotation=TILT, angular_velocity=(1, 0, 0)) for kind in kinds
    ]
    world.step(DT)
    for guest in guests:
        guest.positions()
        world.despawn(guest)
    world.step(DT)
    assert compiled == []


def test_an_adapter_reads_who_comes_and_refuses_who_went(empty):
    world, (kind, _) = empty
    adapter = EngineAdapter(world, FixedStep(dt=DT, substeps=2))
    adapter.advance(1.5 * DT)
    resident = world.spawn(kind, position=(3, 0, 0))
    adapter.positions(resident)  # and with it all bodies, for this alpha
    body = world.spawn(kind, position=(0, 0, 5))
    start = (MESH.vertices + np.array([0, 0, 5])).astype(np.float32)
    np.testing.assert_array_equal(adapter.positions(body), start)
    adapter.advance(DT)
    expected = 0.5 * start + 0.5 * body.positions().astype(float)
    np.testing.assert_allclose(adapter.positions(body), expected, atol=1e-6)
    out = np.full((27, 3), 7, dtype=np.float32)
    world.despawn(body)
    again = world.spawn(kind, position=(0, 0, 8))
    with pytest.raises(StateError, match="body 1 was removed"):
        adapter.positions(body, out)
    assert (out == 7).all()
    assert adapter.positions(again)[:, 2].min() == pytest.approx(7.5)


def test_who_went_gives_colliders_no_impulse_and_no_query_finds_him():
    world, kind = bare_world(soft_contact=True), cube()
    world.reserve(kind, 3)
    build(world)
    guest = world.spawn(kind, position=(0, 0, 0.5))
    for _ in range(20):
        world.step(DT)
    above = {"origin": (0.1, 0.2, 9), "direction": (0, 0, -1)}
    assert world.floor_collider.impulse[2] < 0
    assert world.raycast(**above).body is guest
    world.despawn(guest)
    assert world.raycast(**above) is None
    assert world.closest_point((0, 0, 0.5)) is None
    assert world.overlap_sphere((0, 0, 0.5), 2.0) == ()
    world.step(DT)
    assert world.floor_collider.impulse.tolist() == [0, 0, 0]
    with pytest.raises(OptionError, match="removed"):
        world.raycast(**above, bodies=[guest])
    far, near = (world.spawn(kind, position=(x, 0, 3)) for x in (20, 0))
    assert (far.index, near.index) == (0, 1)
    assert world.raycast(**above).body is near
    assert world.closest_point((20, 0, 3)).body is far
    assert [overlap.body for overlap in world.overlap_sphere((0, 0, 3), 0.1)] == [near]


CENTERS = [
    kind.description.masses @ kind.mesh.vertices / kind.description.masses.sum() for kind in (cube(), ball())
]
"""Of mass, of what is in the pools."""

CALLS = st.lists(
    st.one_of(
        st.tuples(st.just("spawn"), st.integers(0, 1)),
        st.tuples(st.just("despawn"), st.integers(0, 20)),
        st.tuples(st.just("step"), st.integers(1, 3)),
    ),
    max_size=30,
)


@pytest.fixture(scope="module")
def flat_play():
    world = bare_world(floor=None, schedule="flat")
    kinds = (cube(), ball())
    for kind in kinds:
        world.reserve(kind, 3)
    return build(world), kinds


@pytest.mark.parametrize("which", ["play", "flat_play"])
@settings(max_examples=30)
@given(calls=CALLS)
def test_whatever_comes_and_goes_those_who_live_fall_freely_and_the_dead_stay_dead(which, request, calls):
    """Against a list of who lives in which slot, and the parabola of each one's fall."""
    world, kinds = request.getfixturevalue(which)
    for body in world.bodies:
        world.despawn(body)
    free = [[0, 1, 2], [3, 4, 5]]
    living, born, dead = {}, {}, []
    for call, number in calls:
        if call == "spawn" and free[number]:
            place = np.array([3.0 * len(dead), 0.0, 3.0 * len(living)])
            body = world.spawn(kinds[number], position=place, velocity=(0, number, 2))
            assert body.index == heapq.heappop(free[number])
            living[body.index] = body
            born[body] = (place + CENTERS[number], np.array([0, number, 2]), world.time)
        elif call == "spawn":
            with pytest.raises(StateError, match="is full: 3 of 3"):
                world.spawn(kinds[number])
        elif call == "despawn" and living:
            body = living.pop(sorted(living)[number % len(living)])
            world.despawn(body)
            dead.append(body)
            heapq.heappush(free[body.index // 3], body.index)
        elif call == "step":
            for _ in range(number):
                world.step(DT, 4)
        assert world.bodies == tuple(living[slot] for slot in sorted(living))
    for body in living.values():
        start, speed, moment = born[body]
        t = world.time - moment
        fallen = start + speed * t - np.array([0, 0, 0.5 * 9.81 * t * t])
        np.testing.assert_allclose(body.center_of_mass(), fallen, atol=2e-4)
    for body in dead:
        assert not body.is_alive
        with pytest.raises(StateError, match="was removed"):
            body.positions()
