"""The thesis's main job: a sphere of E = 1 MPa dropped from 7 m, at 700 substeps a second (section 6.6)."""

import gc
import math
import warnings

import numpy as np
import pytest

from taichi_soft import PRESETS, FrozenBodyWarning, Material, UnstableStepWarning, preset, sphere
from taichi_soft.world.bare import bare_world

DT, SUBSTEPS = 1 / 50, 14


def drop(mesh, material, seconds, substeps=SUBSTEPS, **options):
    """World, body and the height of its centre every tenth of a second."""
    world = bare_world(retries=0)
    body = world.add_body(mesh, material, position=(0, 0, 7.0), law="virial", **options)
    world.build()
    heights = []
    for step in range(round(seconds / DT)):
        world.step(DT, substeps)
        if step % 5 == 4:
            heights.append(body.center_of_mass()[2])
    return world, body, np.array(heights)


def speed_of(world, body):
    """Fastest vertex over one more step [m/s], from positions."""
    before = body.positions().astype(float)
    world.step(DT, SUBSTEPS)
    return np.linalg.norm(body.positions() - before, axis=1).max() / DT


def test_it_bounces_and_comes_to_rest_whole(thesis_mesh):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world, body, heights = drop(thesis_mesh, preset("thesis_sphere"), 200.0)
    impact = int(heights[:20].argmin())
    assert heights[impact] < 2.0
    assert heights[impact : impact + 30].max() > 4.0  # rises again, by more than half of its height
    tops = [heights[i : i + 100].max() for i in range(0, 600, 100)]
    assert (np.diff(tops[1:4]) < 0).all()
    assert body.failure is None
    assert speed_of(world, body) < 0.2
    assert np.ptp(heights[-50:]) < 0.02
    assert body.flipped_count() == 0
    assert body.volume() == pytest.approx(thesis_mesh.volume, rel=0.03)
    assert body.positions()[:, 2].min() >= 0.0


def test_material_of_the_preset():
    material = preset("thesis_sphere")
    constants = (material.young, material.poisson, material.density, material.damping)
    assert constants == (1e6, 0.1, 1000.0, 100.0)


@pytest.mark.parametrize("young", [1e5, 2e4])
def test_one_that_is_too_soft_stays_dented(thesis_mesh, young):
    """With tolerant flips, tetrahedra that the impact inverts come to rest inverted."""
    world, body, heights = drop(thesis_mesh, Material(young, 0.1, 1000.0, 100.0, damping_ratio=0.0), 30.0)
    assert body.failure is None
    assert np.isfinite(body.positions()).all()
    assert body.flipped_count() > 0
    assert np.abs(body.volumes()).sum() < 1.5 * thesis_mesh.volume
    assert heights.max() <= 7.01
    assert 0 < heights[-1] < 0.9
    assert speed_of(world, body) < 0.5
    assert np.linalg.norm(body.positions() - body.center_of_mass(), axis=1).max() < 3.0


@pytest.mark.parametrize("young", [1e7, 1e8])
def test_one_that_is_too_stiff_is_warned_about_then_frozen(thesis_mesh, young):
    world = bare_world(retries=0)
    body = world.add_body(
        thesis_mesh,
        Material(young, 0.1, 1000.0, 100.0, damping_ratio=0.0),
        position=(0, 0, 7.0),
        law="virial",
    )
    world.build()
    needed = world.stable_substeps(DT)
    assert needed > SUBSTEPS
    limit = body.stable_step.limit
    assert limit < DT / SUBSTEPS

    history = [body.positions()]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        while not body.is_frozen and len(history) < 100:
            world.step(DT, SUBSTEPS)
            history.append(body.positions())
    assert [type_of.category for type_of in caught] == [UnstableStepWarning, FrozenBodyWarning]
    advice, report = (str(one.message) for one in caught)
    assert f"substeps={needed}" in advice
    assert f"{limit * 1e3:.4g} ms" in advice
    assert f"{DT / SUBSTEPS * 1e3:.4g} ms" in advice
    assert caught[0].filename == __file__  # points at the caller

    failure = body.failure
    assert failure.body == 0
    assert failure.step == world.step_count - 1 == len(history) - 2
    assert failure.time == pytest.approx(failure.step * DT)
    assert 0 <= failure.substep < SUBSTEPS
    assert 0 <= failure.tetrahedron < len(thesis_mesh.tets)
    assert f"in step {failure.step}: restored to t = {failure.time:.4g} s" in report
    assert f"step {failure.step}" in report

    frozen = body.positions()
    assert np.isfinite(frozen).all()
    assert frozen.tobytes() == history[-2].tobytes()
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # said once
        for _ in range(5):
            world.step(DT, SUBSTEPS)
    assert body.positions().tobytes() == frozen.tobytes()
    assert np.isfinite(body.velocities()).all()

    body.set_motion(frozen + np.float32([0, 0, 1]), np.zeros_like(frozen))
    assert not body.is_frozen
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(10):
            world.step(DT)
    assert body.center_of_mass()[2] == pytest.approx(8.0 - 0.5 * 9.81 * 0.2**2, abs=0.02)


def freeze(solo, cube):
    """A stiff cube with one corner pulled far out, after the step that throws it. And what was said."""
    world, body = solo(
        cube,
        Material(1e9, 0.2, 1000.0, damping_ratio=0.0),
        {"gravity": (0, 0, 0), "floor": None, "retries": 0},
    )
    corner = int(np.argmax(cube.vertices.sum(axis=1)))
    x = np.array(cube.vertices)
    x[corner] *= 50
    body.set_motion(x, np.zeros_like(x))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        world.step(1 / 60, 2)
    return corner, x, world, caught


def test_the_tetrahedron_that_failed_first_is_near_the_fault(solo, cube):
    corner, x, world, _ = freeze(solo, cube)
    (body,) = world.bodies
    torn = cube.tets[(cube.tets == corner).any(axis=1)]
    assert np.isin(cube.tets[body.failure.tetrahedron], torn).any()
    assert body.failure.substep == 1  # thrown in the first, out of reach in the second
    assert body.positions().tobytes() == x.astype(np.float32).tobytes()


def test_what_broke_first_can_be_asked_at_any_time_later(solo, cube):
    _, _, twin, _ = freeze(solo, cube)
    early = twin.bodies[0].failure
    _, _, world, _ = freeze(solo, cube)
    (body,) = world.bodies
    rest = body.positions().tobytes()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(5):
            world.step(1 / 60, 3)
    assert body.failure == early
    assert body.failure is body.failure
    assert body.positions().tobytes() == rest


def test_the_report_points_at_the_line_that_steps(solo, cube):
    caught = freeze(solo, cube)[-1]
    unstable, frozen = (one.lineno for one in caught)
    assert frozen == unstable


def test_the_others_go_on_bit_for_bit(thesis_mesh):
    stiff, soft = Material(1e8, 0.1, 1000.0, 100.0, damping_ratio=0.0), preset("thesis_sphere")

    def fall(materials):
        gc.collect()
        world = bare_world(retries=0)
        for material in materials:
            place = (0, 0, 3.0) if material is soft else (5, 0, 3.0)
            world.add_body(thesis_mesh, material, position=place, law="virial")
        world.build()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for _ in range(60):
                world.step(DT, SUBSTEPS)
        motions = [(body.positions().tobytes(), body.velocities().tobytes()) for body in world.bodies]
        return [body.is_frozen for body in world.bodies], motions

    (_, (alone,)) = fall([soft])
    for materials in ([stiff, soft], [soft, stiff]):
        are_frozen, motions = fall(materials)
        assert are_frozen == [material is stiff for material in materials]
        assert motions[materials.index(soft)] == alone


@pytest.mark.parametrize("young", [1e5, 1e6, 1e7, 1e8])
def test_automatic_substeps_are_enough(thesis_mesh, young):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world, body, heights = drop(
            thesis_mesh, Material(young, 0.1, 1000.0, 100.0, damping_ratio=0.0), 4.0, substeps=None
        )
    assert body.failure is None
    assert heights.max() <= 7.01
    if young > 1e5:
        assert body.flipped_count() == 0
    assert world.stable_substeps(DT) == math.ceil(DT / body.stable_step.recommended)


def test_the_warning_comes_once_for_each_substep(solo, cube):
    stiff = Material(1e7, 0.2, 1000.0, 20.0, damping_ratio=0.0)
    world, body = solo(cube, stiff, {"gravity": (0, 0, 0), "floor": None})
    for _ in range(2):
        body.set_motion(cube.vertices, np.zeros_like(cube.vertices))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for substeps in (1, 2, 1, 2):
                world.step(1 / 60, substeps)
        unstable = [one for one in caught if one.category is UnstableStepWarning]
        assert len(unstable) in (0, 2)
    assert unstable == []


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_survives_a_fall_of_two_metres_and_keeps_its_volume(name):
    """With substeps as chosen; gelatine as its description says. The thesis's law for all the others."""
    mesh = sphere(0.5, 3)
    world = bare_world()
    flips = "recover" if name == "gelatine" else "tolerant"
    body = world.add_body(mesh, preset(name), flips=flips, position=(0, 0, 2.5))
    world.build()
    for _ in range(240):
        world.step(1 / 60)
    assert not body.is_frozen
    assert body.flipped_count() == 0
    assert body.volume() == pytest.approx(mesh.volume, rel=0.05)
