"""The whole public face under bad input: each call refuses it by name, and nothing has happened."""

import inspect
import warnings
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from public_face import (
    CALLS,
    DEAD,
    DT,
    MAKERS,
    READABLE_WHEN_DEAD,
    READERS,
    SUBSTEPS,
    Game,
    NothingThereError,
    Of,
)
from reading import burst, leave, not_finite

import engine_adapter
import taichi_soft
from taichi_soft import TaichiSoftError, box
from taichi_soft.world.bare import bare_world

CLASSES = {name: getattr(taichi_soft, name, None) or getattr(engine_adapter, name) for name in CALLS}
NAMES = [f"{kind}.{name}" for kind, calls in CALLS.items() for name in calls]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return Game(tmp_path_factory.mktemp("game"))


@pytest.fixture
def game(built):
    built.begin()
    return built


def public_names(kind):
    """Return the names of public methods, properties and fields."""
    handle_fields = {"Collider": ["index"], "Grab": ["body"], "Listener": ["function", "is_active", "kind"]}
    handle_fields["Attachment"] = ["body", "frame", "particles", "two_way"]
    handle_fields["Motor"] = ["body", "particles"]
    handle_fields["Joint"] = ["body", "other", "particles"]
    names = {n for n in [*dir(CLASSES[kind]), *handle_fields.get(kind, [])] if not n.startswith("_")}
    return names - {"given_up"}  # an old name of `budget_status`


@pytest.mark.parametrize("kind", CALLS)
def test_the_table_is_complete(kind):
    """A new public call, or a new argument of one, needs a line in `public_face.CALLS` (or `READERS`)."""
    assert public_names(kind) == set(CALLS[kind]) | set(READERS[kind].split())
    for name, call in CALLS[kind].items():
        parameters = [p for p in inspect.signature(getattr(CLASSES[kind], name)).parameters if p != "self"]
        assert parameters == list(call.takes), name


def world_as_it_is(game):
    """All that a call could have changed: the state, who is there, what waits, where the adapter is."""
    world, events = game.world, game.world._built.events
    return (
        world.state_hash(),
        world.snapshot(),
        world.bodies,
        world.colliders,
        (world.step_count, world.time, world.last_dt, world.dropped_events),
        (game.adapter.alpha, game.adapter.time, game.adapter.total_dropped_time, game.rollback.steps),
        [body.topology_version for body in world.bodies],
        (events._kinds, len(events._waiting), len(events._listeners)),
        (world._force_field, len(world._handles.recorder._present.entries)),
    )


def draw(game, handle, call, rng):
    game.receiver = handle
    return {name: kind.sound(game, rng) for name, kind in call.takes.items()}


def found_in(value, game):
    return value.find(game) if isinstance(value, Of) else value


def refused(game, call, *arguments, **options):
    """Return None if a call is refused with a message and changes nothing; otherwise return what is wrong."""
    before = world_as_it_is(game)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = call(*arguments, **options)
    except TaichiSoftError as error:
        if len(str(error)) < 10:
            return f"says only {str(error)!r}"
    except Exception as error:
        return f"raises {type(error).__name__}: {error}"
    else:
        return f"is taken and returns {found!r}"
    changed = [i for i, (a, b) in enumerate(zip(before, world_as_it_is(game), strict=True)) if a != b]
    return f"changes {changed}" if changed else None


@pytest.mark.guard
@pytest.mark.soak
@pytest.mark.parametrize("name", NAMES)
def test_every_bad_value_of_every_argument_is_refused_and_nothing_changes(game, name):
    kind, _, method = name.partition(".")
    call = CALLS[kind][method]
    wrong = []
    for argument, takes in call.takes.items():
        for label, value in takes.bad.items():
            handle = game.handles(kind)[0]  # of bodies one that sleeps
            given_ = draw(game, handle, call, np.random.default_rng(1))
            given_[argument] = found_in(value, game)
            told = refused(game, getattr(handle, method), **given_)
            if told:
                wrong.append(f"{argument} = {label}: {told}")
                game.begin()
    assert not wrong, "\n".join(wrong)


@pytest.mark.soak
@pytest.mark.parametrize("kind", MAKERS, ids=lambda kind: kind.__name__)
def test_nothing_is_made_of_bad_values(game, kind):
    takes, wrong = MAKERS[kind], []
    assert list(inspect.signature(kind).parameters) == list(takes)
    for argument in takes:
        for label, value in takes[argument].bad.items():
            rng = np.random.default_rng(1)
            given_ = {name: each.sound(game, rng) for name, each in takes.items()}
            told = refused(game, kind, **given_ | {argument: found_in(value, game)})
            if told:
                wrong.append(f"{argument} = {label}: {told}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.soak
@pytest.mark.parametrize("kind", DEAD)
def test_a_dead_handle_does_nothing_and_says_so(game, kind):
    handle, wrong = getattr(game, DEAD[kind]), []
    for name in sorted(public_names(kind) - set(READABLE_WHEN_DEAD[kind].split())):
        call = CALLS[kind].get(name)
        alive = game.handles(kind)[0]
        given_ = draw(game, alive, call, np.random.default_rng(1)) if call else {}

        def ask(name=name, given_=given_):
            found = getattr(handle, name)
            return found(**given_) if callable(found) else found

        told = refused(game, ask)
        if told:
            wrong.append(f"{name} {told}")
    assert not wrong, "\n".join(wrong)
    for name in READABLE_WHEN_DEAD[kind].split():
        getattr(handle, name)


@pytest.mark.soak
@pytest.mark.filterwarnings(
    "ignore::taichi_soft.FrozenBodyWarning", "ignore::taichi_soft.UnstableStepWarning"
)
@pytest.mark.parametrize("name", ["free", "held", "hanging", "sleeper", "piece"])
def test_all_that_is_read_stays_finite_whichever_body_freezes(game, name):
    """The body is free, grabbed, attached, asleep or cut off, in a world with colliders.

    `test_finite_readout.py` has worlds without contact.
    """
    world = game.world
    pieces = game.free.cut(plane=(game.free.center_of_mass(), (1.0, 0.2, 0.1)))
    body = pieces[0] if name == "piece" else getattr(game, name)
    data = world.snapshot()
    for destroy in (burst, leave):
        world.restore(data)
        destroy(body)
        for substeps in (1, SUBSTEPS, SUBSTEPS):
            world.step(DT, substeps)
            assert not_finite(world, game.adapter) == []
        assert body.is_frozen
        if name == "held":
            assert not np.concatenate([game.hold.force, game.hold.torque, game.hand.force]).any()


BAD_FIELDS = {
    "nan": lambda x, t: np.full_like(x, np.nan),
    "fewer": lambda x, t: x[:-1],
    "text": lambda x, t: "up",
    "nothing": lambda x, t: None,
    "huge": lambda x, t: np.full_like(x, 1e20),
    "ragged": lambda x, t: [[1.0], [2.0, 3.0]],
}


@pytest.mark.soak
@pytest.mark.parametrize("name", BAD_FIELDS)
def test_a_force_field_that_gives_no_accelerations_stops_the_step(game, name):
    game.world.set_force_field(BAD_FIELDS[name])
    assert refused(game, game.world.step, DT, SUBSTEPS) is None


class Act(NamedTuple):
    """A call: which, with which draws, and the bad value of one argument in place of a sound one, or none."""

    name: str
    seed: int
    bad: int | None


def sequences():
    acts = st.builds(
        Act,
        st.sampled_from(NAMES),
        st.integers(0, 999),
        st.none() | st.integers(0, 999),
    )
    return st.lists(acts, min_size=8, max_size=24)


def perform(game, act):
    """A sound call: made, unless nobody can make it; refused only where it comes at the wrong time."""
    kind, _, method = act.name.partition(".")
    call, rng = CALLS[kind][method], np.random.default_rng(act.seed)
    handles = game.handles(kind)
    if not handles or not game.world.bodies:
        return
    handle = handles[rng.integers(len(handles))]
    try:
        given_ = draw(game, handle, call, rng)
    except NothingThereError:
        return
    is_wrong_time = call.refused(game, handle, given_)
    before = None if is_wrong_time is False else world_as_it_is(game)
    error = None
    try:
        getattr(handle, method)(**given_)
    except TaichiSoftError as refusal:
        error = refusal
    if error is None:
        assert is_wrong_time is not True, f"{act.name} {given_} should have been refused"
    else:
        assert is_wrong_time is not False, f"{act.name} {given_}: {error}"
        assert world_as_it_is(game) == before, act


def misuse(game, act):
    """Make a call with an invalid value."""
    kind, _, method = act.name.partition(".")
    call, rng = CALLS[kind][method], np.random.default_rng(act.seed)
    handles = game.handles(kind)
    bad = [(name, label) for name, takes in call.takes.items() for label in takes.bad]
    if not handles or not bad:
        return
    handle = handles[rng.integers(len(handles))]
    name, label = bad[act.bad % len(bad)]
    try:
        given_ = draw(game, handle, call, rng)
    except NothingThereError:
        return
    given_[name] = found_in(call.takes[name].bad[label], game)
    told = refused(game, getattr(handle, method), **given_)
    assert told is None, f"{act.name} with {name} = {label} {told}"


def story(game, acts, *, with_bad):
    """Hashes of the states after each call and step; all of them finite."""
    game.begin()
    told = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", taichi_soft.FrozenBodyWarning)
        warnings.simplefilter("ignore", taichi_soft.UnstableStepWarning)
        for act in acts:
            if act.bad is None:
                perform(game, act)
                game.world.step(DT, SUBSTEPS)
                for body in game.world.bodies:
                    assert np.isfinite(body.positions()).all(), act
                    assert np.isfinite(body.velocities()).all(), act
                told.append(game.world.state_hash())
            elif with_bad:
                misuse(game, act)
    return told


@pytest.mark.soak
@settings(
    max_examples=30,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(acts=sequences())
def test_a_world_that_got_bad_calls_goes_on_as_one_that_did_not(built, acts):
    """Any calls in any order: sound ones are taken and leave a finite state, bad ones leave no trace."""
    assert story(built, acts, with_bad=True) == story(built, acts, with_bad=False)


REFUSED_OF_RIGID = READERS["Body"].split()
REFUSED_OF_RIGID = {name for name in REFUSED_OF_RIGID if "strain" in name or "stress" in name}
REFUSED_OF_RIGID |= {
    "deformations",
    "force_across",
    "render_mesh",
    "set_damping",
    "watch_stress",
    "watch_tearing",
}


@pytest.mark.soak
def test_a_rigid_body_has_the_measures_of_a_solid_and_refuses_what_needs_strain():
    side, at = 0.2, np.array([0.0, 0.0, 0.5])
    world = bare_world(soft_contact=True)
    body = world.add_rigid(box((side, side, side)), mass=1.0, position=at, angular_velocity=(0, 0, 1))
    world.build()
    arguments = {"watch_stress": (1e4,), "watch_tearing": (1e4,), "set_damping": (1.0,)}
    arguments |= {"force_across": (at, (0, 0, 1)), "render_mesh": ()}
    for name in [*READERS["Body"].split(), "positions", *arguments]:
        before = world.state_hash()
        if name in REFUSED_OF_RIGID:
            with pytest.raises(TaichiSoftError, match="rigid"):
                getattr(body, name)(*arguments.get(name, ()))
        else:
            value = getattr(body, name)
            _ = value() if inspect.ismethod(value) else value
        assert world.state_hash() == before, name
    corners = np.array([at - side / 2, at + side / 2])
    assert np.array(body.aabb()) == pytest.approx(corners, abs=1e-6)
    assert body.volume() == pytest.approx(side**3, rel=1e-6)
    assert body.kinetic_energy() == pytest.approx(0.5 * side**2 / 6, rel=1e-6)  # 1/2 I w^2
    assert body.elastic_energy() == 0.0
