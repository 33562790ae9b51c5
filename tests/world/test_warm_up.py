"""`World.warm_up`: nothing is compiled after it, and nothing has happened."""

import inspect
import warnings
from contextlib import nullcontext, suppress

import numpy as np
import pytest
from public_face import CALLS, DT, READERS, SUBSTEPS, Game

from taichi_soft import (
    Event,
    FrozenBodyWarning,
    Material,
    Plasticity,
    SoftBodyAsset,
    StateError,
    TaichiSoftError,
    Tearing,
    World,
    box,
)
from taichi_soft.bodies import render_mesh
from taichi_soft.control.kernels.grabs import MOST_GRABS
from taichi_soft.control.kernels.joints import MOST_JOINTS
from taichi_soft.control.kernels.motors import MOST_MOTORS
from taichi_soft.core.compilation import BURST
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def compiled():
    """Names of the kernels that were compiled, or loaded from a cache, since it was cleared."""
    names, inner = [], BURST.begin

    def noted(name):
        names.append(name)
        return inner(name)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(BURST, "begin", noted)
        yield names


@pytest.fixture(scope="module")
def game(tmp_path_factory, compiled):
    """A game that was warmed up when it had nothing but empty slots, in fields that no other test uses.

    `compiled_at_start`: what was compiled between that and its first tick.
    """
    warm_up = World.warm_up

    def warmed(world):
        warm_up(world)
        compiled.clear()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(World, "warm_up", warmed)
        made = Game(tmp_path_factory.mktemp("game"), slots=66, warm=True)
    made.compiled_at_start = list(compiled)
    return made


def test_nothing_is_compiled_where_what_yields_tears(compiled):
    """A tear within a step reads the plastic strain, as does a call that reads the stress."""
    bar = SoftBodyAsset(
        box((3, 1, 1), cells=(3, 1, 1)),
        Material(1e5, 0.3, 1000.0),
        plasticity=Plasticity(yield_strain=0.5),
        tearing=Tearing(3e4),
        spare_vertices=40,
    )
    world = bare_world(gravity=(0, 0, 0), floor=None)
    world.reserve(bar, 3)
    world.build()
    world.warm_up()
    compiled.clear()
    body = world.spawn(bar)
    body.set_motion(body.positions() * np.float32([1.5, 1, 1]), body.velocities())
    world.step(DT, SUBSTEPS)
    assert body.topology_version > 0
    assert body.tet_stress().max() > 0.0
    assert body.plastic_strains().shape == (len(body.tets),)
    for each in world.bodies:
        world.despawn(each)
    lost = world.spawn(bar)
    rows = np.ones((lost.vertex_count, 3))
    lost.set_motion(9.9999e6 * rows, 1.9e4 * rows)
    with pytest.warns(FrozenBodyWarning):
        world.step(DT, SUBSTEPS)
    assert compiled == []
    assert lost.failure is not None
    assert compiled == ["find_failed_element"]


@pytest.mark.guard
def test_nothing_is_compiled_while_the_game_is_filled(game):
    assert game.compiled_at_start == []


REFUSED = ("World.add_body", "World.add_rigid", "World.reserve", "World.build", "World.connect")
"""Calls that are refused once a world is built, and `connect`, which needs a rigid body. The game has none:
see `test_nothing_is_compiled_where_rigid_bodies_are_connected`."""

NAMES = [f"{kind}.{name}" for kind, calls in CALLS.items() for name in calls]


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_compiled_in_the_game(game, compiled, name):
    kind, _, method = name.partition(".")
    call = CALLS[kind][method]
    compiled.clear()
    calls = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)
        for seed in range(3):
            game.begin()
            for _ in range(3 if kind == "EngineAdapter" else 0):
                game.adapter.step()  # to have something to rewind
            rng = np.random.default_rng(seed)
            handle = game.receiver = game.handles(kind)[seed % len(game.handles(kind))]
            given = {argument: takes.sound(game, rng) for argument, takes in call.takes.items()}
            expected = call.refused(game, handle, given)
            if expected is True:
                continue
            with suppress(TaichiSoftError) if expected is None else nullcontext():
                getattr(handle, method)(**given)
                calls += 1
            game.world.step(DT, SUBSTEPS)
    assert compiled == []
    assert calls > 0 or name in REFUSED


@pytest.mark.parametrize("kind", READERS)
def test_nothing_is_compiled_where_the_game_looks(game, compiled, kind):
    game.begin()
    game.world.record_events([Event])
    compiled.clear()
    game.world.step(DT, SUBSTEPS)
    for name in READERS[kind].split():
        with suppress(StateError):  # raised by `bodies_inside` of a collider that is no sensor
            found = getattr(game.handles(kind)[0], name)
            if inspect.ismethod(found):
                found()
    assert compiled == []


def test_nothing_is_compiled_where_rigid_bodies_are_connected(compiled):
    world = bare_world(soft_contact=True)
    block = box((0.2, 0.2, 0.2))
    door, pillar = (world.add_rigid(block, mass=1.0, position=(x, 0, 0.2)) for x in (0.0, 0.3))
    jelly = world.add_body(box((0.3, 0.3, 0.3), (1, 1, 1)), Material(1e5, 0.3, 1000.0), position=(0, 0, 0.6))
    world.build()
    world.warm_up()
    compiled.clear()
    joints = [
        world.connect(door, pillar, kind, anchor=(0.15, 0, 0.2)) for kind in ("ball", "hinge", "slider")
    ]
    joints.append(world.connect(door, jelly, anchor=(0, 0, 0.46)))
    world.step(DT, 2 * SUBSTEPS)
    assert all(joint.is_attached and np.isfinite(joint.force).all() for joint in joints)
    assert compiled == []


@pytest.mark.parametrize("fewest_shared", [0, 10**9], ids=["by all threads", "by one"])
def test_nothing_is_compiled_where_a_mesh_of_any_size_is_drawn(game, compiled, monkeypatch, fewest_shared):
    monkeypatch.setattr(render_mesh, "MIN_PARALLEL_VERTICES", fewest_shared)
    game.begin()
    compiled.clear()
    for crease in (None, 30.0):
        _, normals = game.adapter.render_mesh(game.free.render_mesh(crease=crease))
        assert np.isfinite(normals).all()
    assert compiled == []


def test_it_leaves_the_world_as_it_is(game):
    """This test runs last, because it compiles kernels that the other tests count."""
    game.begin()
    world = game.world
    before = world.snapshot(), world.state_hash(), world.bodies, world.colliders, world.step_count
    world.warm_up()
    assert (world.snapshot(), world.state_hash(), world.bodies, world.colliders, world.step_count) == before


def test_it_is_no_trouble_where_all_joints_grabs_and_motors_are_in_use(game):
    game.begin()
    world = game.world
    for _ in range(MOST_JOINTS - len(world.joints)):
        game.hanging.attach_to(game.held, [0], onto=[0])
    for _ in range(MOST_GRABS - len(world.grabs)):
        game.free.grab(0)
    for _ in range(MOST_MOTORS - len(world.motors)):
        world.add_motor(game.free, [0], (0, 0, 1), speed=1.0, max_force=1.0, is_fixed=True)
    before = world.snapshot()
    world.warm_up()
    assert world.snapshot() == before
