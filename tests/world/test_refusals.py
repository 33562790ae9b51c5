"""Bad input: a clear error, and nothing changed."""

from pathlib import Path

import numpy as np
import pytest

from taichi_soft import (
    Material,
    MaterialError,
    MeshError,
    OptionError,
    ParticleMesh,
    StateError,
    TaichiSoftError,
    UnstableStepWarning,
)
from taichi_soft.world.bare import bare_world

NAN, INF = float("nan"), float("inf")


ROOT = Path(__file__).parents[2]


def snapshot(world):
    """Positions, velocities and counters."""
    bodies = [(b.positions().tobytes(), b.velocities().tobytes(), b.failure) for b in world.bodies]
    before = [world.read_positions(b, 0.0).tobytes() for b in world.bodies]
    return bodies, before, world.step_count, world.time, world.is_built


@pytest.fixture
def falling(solo, cube, jelly):
    """A world in the middle of a fall."""
    world, body = solo(cube, jelly, position=(0, 0, 1.0), velocity=(0.1, 0, 0))
    for _ in range(5):
        world.step(1 / 60, 4)
    return world, body


@pytest.mark.parametrize("dt", [0, 0.0, -1 / 60, NAN, INF, -INF, "1/60", None, True, [1 / 60], 1j])
def test_steps_of_no_length(falling, dt):
    world, _ = falling
    before = snapshot(world)
    with pytest.raises(OptionError, match="dt must be"):
        world.step(dt, 4)
    with pytest.raises(OptionError, match="dt must be"):
        world.step(dt)
    assert snapshot(world) == before


@pytest.mark.parametrize("substeps", [0, -3, 1.5, 4.0, True, False, "4", NAN])
def test_substeps_that_are_no_count(falling, substeps):
    world, _ = falling
    before = snapshot(world)
    with pytest.raises(OptionError, match="substeps must be"):
        world.step(1 / 60, substeps)
    assert snapshot(world) == before


def test_a_refused_step_leaves_the_motion_as_it_would_have_been(solo, cube, jelly):
    ends = []
    for is_disturbed in (False, True):
        world, body = solo(cube, jelly, position=(0, 0, 0.7))
        for _ in range(30):
            world.step(1 / 60, 4)
            if is_disturbed:
                with pytest.raises(OptionError):
                    world.step(NAN, 4)
                with pytest.raises(OptionError):
                    world.step(1 / 60, 0)
        ends.append(body.positions().tobytes())
    assert ends[0] == ends[1]


def test_one_is_a_count_but_true_is_not(falling):
    """True equals 1, so an earlier check of 1 must not make True valid."""
    world, _ = falling
    world.step(1 / 600, 1)
    with pytest.raises(OptionError, match="substeps must be"):
        world.step(1 / 600, True)


def test_nothing_runs_before_build(cube, jelly):
    world = bare_world(floor=None)
    body = world.add_body(cube, jelly)
    zeros = np.zeros((27, 3))
    calls = [
        lambda: world.step(1 / 60),
        lambda: world.step(1 / 60, 4),
        body.positions,
        body.velocities,
        body.volume,
        body.flipped_count,
        body.momentum,
        body.kinetic_energy,
        body.elastic_energy,
        lambda: body.set_motion(zeros, zeros),
        lambda: world.read_positions(body, 0.5),
    ]
    for call in calls:
        with pytest.raises(StateError, match="build"):
            call()
    assert (world.step_count, world.time, world.is_built) == (0, 0.0, False)
    world.build()
    world.step(1 / 60)


def test_an_empty_world_is_not_built():
    world = bare_world()
    for call in (world.build, lambda: world.stable_substeps(1 / 60)):
        with pytest.raises(StateError, match="add_body"):
            call()
    assert not world.is_built


def test_a_world_is_built_once_and_complete(falling, cube, jelly):
    world, _ = falling
    before = snapshot(world)
    with pytest.raises(StateError, match="already built"):
        world.build()
    with pytest.raises(StateError, match="already built"):
        world.add_body(cube, jelly)
    assert len(world.bodies) == 1
    assert snapshot(world) == before


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("integrator", "verlet"),
        ("integrator", 3),
        ("schedule", "fast"),
        ("schedule", None),
        ("gravity", (0, 0)),
        ("gravity", -9.81),
        ("gravity", (0, 0, NAN)),
        ("gravity", (0, INF, 0)),
        ("gravity", "down"),
        ("floor", NAN),
        ("floor", INF),
        ("floor", "ground"),
        ("floor", True),
        ("floor", (0, 0)),
        ("restitution", 2),
        ("restitution", -0.1),
        ("restitution", NAN),
        ("restitution", "1"),
        ("friction", -0.5),
        ("friction", NAN),
        ("friction", INF),
        ("friction", None),
    ],
)
def test_worlds_that_cannot_be(name, value):
    with pytest.raises(OptionError, match=name):
        bare_world(**{name: value})


@pytest.mark.parametrize("name", ["settings", "time", "step_count", "bodies", "is_built"])
def test_a_world_is_not_changed_behind_its_kernels_back(falling, name):
    world, _ = falling
    with pytest.raises(AttributeError):
        setattr(world, name, 3)


@pytest.mark.parametrize("name", ["gravity", "floor", "restitution", "friction", "integrator", "schedule"])
def test_settings_stay_as_they_were_checked(falling, name):
    world, _ = falling
    with pytest.raises(AttributeError):
        setattr(world.settings, name, 0.5)
    with pytest.raises(ValueError, match="read-only"):
        world.settings.gravity[2] = 0.0


def test_settings_say_which_schedule_was_chosen(cube, jelly):
    world = bare_world(gravity=(0, 0, -1.6), floor=None, integrator="explicit_euler")
    assert world.settings.schedule == "auto"
    world.add_body(cube, jelly)
    world.build()
    found = world.settings
    assert (found.schedule, found.floor, found.integrator) == ("flat", None, "explicit_euler")
    assert found.gravity.tolist() == [0, 0, -1.6]


SHEAR = [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]
MIRROR = np.diag([1.0, 1.0, -1.0])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("law", "neo_hooke"),
        ("strain", "green"),
        ("flips", "never"),
        ("damping_model", "air"),
        ("position", (0, 0)),
        ("position", (0, 0, NAN)),
        ("position", (INF, 0, 0)),
        ("position", "here"),
        ("position", [[0, 0, 0]]),
        ("velocity", 3.0),
        ("velocity", (0, NAN, 0)),
        ("velocity", (0, 0, 0, 0)),
        ("rotation", [[1], [1, 2]]),
        ("rotation", 4),
        ("rotation", "up"),
        ("rotation", SHEAR),
        ("rotation", MIRROR),
        ("rotation", 2 * np.eye(3)),
        ("rotation", np.zeros((3, 3))),
        ("rotation", np.full((3, 3), NAN)),
        ("rotation", np.eye(4)),
        ("rotation", (0, 0, 0, 2)),
        ("rotation", (0, 0, 0, 0)),
        ("rotation", (0, 0, NAN, 1)),
        ("rotation", 90),
    ],
)
def test_bodies_that_cannot_be(cube, jelly, name, value):
    world = bare_world(floor=None)
    with pytest.raises(OptionError, match=name.split("_")[0]):
        world.add_body(cube, jelly, **{name: value})
    assert world.bodies == ()


def test_unknown_names_are_answered_with_those_there_are(cube, jelly):
    with pytest.raises(OptionError, match=r"'virial'.*'face'|'face'.*'virial'"):
        bare_world(floor=None).add_body(cube, jelly, law="neo_hooke")
    with pytest.raises(OptionError, match=r"'tolerant', 'recover', 'off'"):
        bare_world(floor=None).add_body(cube, jelly, flips="never")
    with pytest.raises(OptionError, match=r"'auto', 'per_body', 'flat'"):
        bare_world(schedule="fast")


@pytest.mark.parametrize("material", [None, 1e5, "rubber", {"young": 1e5}, Material])
def test_what_is_no_material(cube, material):
    world = bare_world(floor=None)
    with pytest.raises(MaterialError, match=r"taichi_soft\.Material"):
        world.add_body(cube, material)
    assert world.bodies == ()


@pytest.mark.parametrize("name", ["young", "poisson", "density", "damping"])
def test_an_array_of_another_length(cube, name):
    constants = {"young": 1e5, "poisson": 0.2, "density": 1000.0, "damping": 1.0}
    constants[name] = np.full(39, constants[name])
    world = bare_world(floor=None)
    with pytest.raises(MaterialError, match=r"39 values.*40"):
        world.add_body(cube, Material(**constants))
    assert world.bodies == ()
    world.add_body(cube, Material(1e5, 0.2, 1000.0))
    world.build()  # no trace of the refused one
    assert world.bodies[0].index == 0


@pytest.mark.parametrize("mesh", [None, "cube", np.zeros((4, 3))])
def test_what_is_no_mesh(jelly, mesh):
    with pytest.raises(MeshError, match="TetMesh"):
        bare_world(floor=None).add_body(mesh, jelly)


def test_particle_meshes_need_another_law(jelly):
    particles = ParticleMesh([[0, 0, 0], [1, 0, 0]], [[0, 1]], 1.0)
    with pytest.raises(MeshError, match=r"ParticleMesh.*no tetrahedra"):
        bare_world(floor=None).add_body(particles, jelly)


@pytest.mark.parametrize(
    ("positions", "velocities", "named"),
    [
        (np.zeros((26, 3)), np.zeros((27, 3)), "positions"),
        (np.zeros((27, 3)), np.zeros((27, 2)), "velocities"),
        (np.zeros(81), np.zeros((27, 3)), "positions"),
        (np.full((27, 3), NAN), np.zeros((27, 3)), "positions"),
        (np.zeros((27, 3)), np.full((27, 3), INF), "velocities"),
        (np.full((27, 3), 1e39), np.zeros((27, 3)), "positions must lie within"),
        (np.zeros((27, 3)), np.full((27, 3), -1e39), "velocities must lie within"),
        (np.full((27, 3), 2e7), np.zeros((27, 3)), "positions must lie within"),
        ("there", np.zeros((27, 3)), "positions"),
        (None, np.zeros((27, 3)), "positions"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_motion_that_does_not_fit(falling, positions, velocities, named):
    world, body = falling
    before = snapshot(world)
    with pytest.raises(OptionError, match=named):
        body.set_motion(positions, velocities)
    assert snapshot(world) == before


def test_buffers_that_do_not_fit(falling, unfit_buffer):
    world, body = falling
    before = snapshot(world)
    out = unfit_buffer(body.vertex_count)
    with pytest.raises(OptionError, match="out must be"):
        body.positions(out)
    assert not np.any(out)
    assert snapshot(world) == before


@pytest.mark.parametrize("dt", [0, -1, NAN, "1"])
def test_substeps_for_no_step(falling, dt):
    with pytest.raises(OptionError, match="dt"):
        falling[0].stable_substeps(dt)


# Numbers that are finite in Python and not in float32, in which the world computes.


@pytest.mark.parametrize("name", ["position", "velocity"])
def test_bodies_out_of_reach(cube, jelly, name):
    world = bare_world()
    with pytest.raises(TaichiSoftError, match=name):
        world.add_body(cube, jelly, **{name: (0, 0, 1e39)})


@pytest.mark.parametrize("position", [(0, 0, 0), (5, 0, 0.4), (0, 0, -3), (0, 0, 0.498)])
def test_bodies_that_start_below_the_floor(cube, jelly, position):
    """The floor would press them flat in one substep. The message says where they fit."""
    world = bare_world()
    with pytest.raises(OptionError, match=r"floor.*position=\(.*, 0\.5\)"):
        world.add_body(cube, jelly, position=position)
    assert world.bodies == ()
    world.add_body(cube, jelly, position=(0, 0, 0.5))
    world.add_body(cube, jelly, position=(0, 0, 0.4999999))


@pytest.mark.parametrize(
    ("scale", "error"), [(1e8, "position puts"), (1e-20, "shortest edge"), (1e-7, "short")]
)
def test_bodies_of_a_size_that_float32_cannot_hold(cube, jelly, scale, error):
    with pytest.raises(TaichiSoftError, match=error):
        bare_world(floor=None).add_body(cube.scaled(scale), jelly)


@pytest.mark.parametrize("dt", [1e-50, 1e308, 1e5])
def test_steps_that_no_one_can_wait_for_or_see(falling, dt):
    world, _ = falling
    before = snapshot(world)
    for call in (world.step, world.stable_substeps):
        with pytest.raises(OptionError, match="dt must be"):
            call(dt)
    assert snapshot(world) == before


@pytest.mark.filterwarnings("error")
def test_a_step_refused_by_a_warning_made_an_error_is_refused_again(solo, cube):
    world, _ = solo(cube, Material(1e9, 0.2, 1000.0), position=(0, 0, 1))
    before = snapshot(world)
    for _ in range(2):
        with pytest.raises(UnstableStepWarning):
            world.step(1 / 60, 1)
        assert snapshot(world) == before


def test_explicit_euler_is_announced_as_unstable(cube, jelly):
    world = bare_world(integrator="explicit_euler")
    world.add_body(cube, jelly, position=(0, 0, 1))
    with pytest.warns(UnstableStepWarning, match="explicit_euler gains energy"):
        world.build()


def test_gravity_out_of_reach():
    with pytest.raises(TaichiSoftError, match="gravity"):
        bare_world(gravity=(0, 0, -1e39))


def test_a_body_of_another_world(falling, solo, cube, jelly):
    _, stranger = solo(cube, jelly)
    with pytest.raises(OptionError, match="world"):
        falling[0].read_positions(stranger, 1.0)


@pytest.mark.parametrize("alpha", [NAN, INF, -0.1, 1.1, "half", None])
def test_alpha_out_of_range(falling, alpha):
    world, body = falling
    with pytest.raises(OptionError, match="alpha"):
        world.read_positions(body, alpha)


@pytest.mark.parametrize("substeps", [2**31, 10**12, 2**70, np.array([1, 2])])
def test_more_substeps_than_anyone_can_wait_for(falling, substeps):
    world, _ = falling
    before = snapshot(world)
    with pytest.raises(OptionError, match="substeps must be"):
        world.step(1 / 60, substeps)
    assert snapshot(world) == before


@pytest.mark.parametrize("dt", [np.array([1.0, 2.0]), 10**400])
def test_steps_that_are_no_number_after_a_good_one(falling, dt):
    world, _ = falling
    before = snapshot(world)
    with pytest.raises(OptionError, match="dt must be"):
        world.step(dt, 4)
    assert snapshot(world) == before
