"""Material changes at run time, and no compilation during calls of a running game."""

import gc
import sys

import numpy as np
import pytest

from taichi_soft import (
    AnisotropicMaterial,
    Material,
    MaterialError,
    SpringMaterial,
    StateError,
    Stiffness,
    box,
    cloth,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

CUBE = box(cells=(2, 2, 2))
SHEET = cloth((1.0, 1.0), (4, 4), 2.0)
SPREAD = np.linspace(0.5, 2.0, len(CUBE.tets))
WOOD = Stiffness.one_axis(4e5, 1e5, 0.2, 0.2, 5e4)
FRAME = (0, 0, 0.6, 0.8)

# law, options, mesh, first material, second material
KINDS = {
    "virial": (
        {},
        CUBE,
        Material(1e5, 0.2, 1000.0, 20.0, damping_ratio=0.0),
        Material(3e5 * SPREAD, -0.1, 700 * SPREAD, 35.0, damping_ratio=0.0),
    ),
    "neo_hookean": (
        {"law": "neo_hookean", "damping_model": "tet_mean"},
        CUBE,
        Material(1e5, 0.2, 1000.0, 20.0, damping_ratio=0.0),
        Material(2e5, 0.4, 900.0, 3.0 * SPREAD, damping_ratio=0.0),
    ),
    "volume_springs": (
        {"law": "volume_springs"},
        CUBE,
        Material(1e5, 0.2, 1000.0, 20.0, damping_ratio=0.0),
        Material(2e5 * SPREAD, 0.3, 1500.0, 10.0, damping_ratio=0.0),
    ),
    "anisotropic": (
        {"law": "st_venant_kirchhoff"},
        CUBE,
        AnisotropicMaterial(WOOD, 1000.0, 20.0, damping_ratio=0.0),
        AnisotropicMaterial(Stiffness.isotropic(2e5, 0.1), 500.0, 10.0, FRAME, damping_ratio=0.0),
    ),
    "springs": (
        {"law": "springs"},
        SHEET,
        SpringMaterial(500.0, 0.1),
        SpringMaterial(np.linspace(200, 500, len(SHEET.edges)), 0.3, 0.9 * SHEET.edge_lengths),
    ),
}


def build(which):
    """A world of one body of each kind, hung by its first vertex, of its first (2) or second (3) material."""
    gc.collect()
    world = bare_world(floor=None)
    bodies = {}
    for place, (name, row) in enumerate(KINDS.items()):
        bodies[name] = world.add_body(row[1], row[which], **row[0], position=(3 * place, 0, 0), pinned=[0])
    world.build()
    return world, bodies


def run(world, bodies):
    for _ in range(12):
        world.step(1 / 60, 16)
    assert not any(body.is_frozen for body in world.bodies)
    return {name: (body.positions(), body.velocities(), body.masses) for name, body in bodies.items()}


@pytest.fixture(scope="module")
def told():
    """Return the motion of bodies built with the second material, and of bodies that get it later."""
    built = run(*build(3))
    world, bodies = build(2)
    for name, body in bodies.items():
        body.set_material(KINDS[name][3])
    return built, run(world, bodies), world, bodies


@pytest.mark.parametrize("name", KINDS)
def test_a_body_with_a_new_material_moves_as_one_built_with_it(told, name):
    built, given, _, bodies = told
    for one, other in zip(built[name], given[name], strict=True):
        assert one.tobytes() == other.tobytes()
    assert bodies[name].material is KINDS[name][3]
    assert bodies[name].pinned.tolist() == [0]


def test_the_first_material_would_have_moved_otherwise(told):
    built, _, world, bodies = told
    for name, body in bodies.items():
        body.set_material(KINDS[name][2])
        body.set_motion(
            body.mesh.vertices + np.array([3.0 * body.index, 0, 0]), np.zeros_like(body.positions())
        )
    again = run(world, bodies)
    for name in KINDS:
        assert np.abs(again[name][0] - built[name][0]).max() > 1e-4


def test_damping_is_changed_alone(told):
    _, _, world, bodies = told
    body = bodies["virial"]
    body.set_material(KINDS["virial"][2])
    body.set_damping(44.0)
    material = body.material
    assert (material.young, material.poisson, material.density, material.damping) == (1e5, 0.2, 1000.0, 44.0)
    squeezed = body.mesh.vertices * [1, 1, 0.8]
    lost = []
    for damping in (0.0, 60.0):
        body.set_damping(damping)
        body.set_motion(squeezed, np.zeros((27, 3)))
        body.unpin()
        body.set_gravity_scale(0.0)
        for _ in range(12):
            world.step(1 / 60, 16)
        lost.append(body.kinetic_energy() + body.elastic_energy())
    assert lost[1] < 0.7 * lost[0]
    body.set_gravity_scale(1.0)
    body.pin([0])


def test_momentum_goes_with_the_density(told):
    _, _, _, bodies = told
    body = bodies["virial"]
    body.unpin()
    body.set_velocity((1.0, 0, 0))
    body.pin([0])
    body.set_material(Material(1e5, 0.2, 2000.0, 20.0, damping_ratio=0.0))
    assert body.masses.sum() == pytest.approx(2000.0)
    assert body.momentum()[0] == pytest.approx(2000.0 - body.masses[0], rel=1e-5)
    body.unpin()
    before = body.momentum()
    body.apply_impulse((0, 100.0, 0))
    np.testing.assert_allclose(body.momentum() - before, [0, 100, 0], atol=1e-3)
    body.pin([0])


def test_the_number_of_substeps_follows_at_once():
    world = bare_world(floor=None)
    body = world.add_body(CUBE, Material(1e5, 0.2, 1000.0, 20.0, damping_ratio=0.0))
    world.build()
    counts = []
    for young in (1e5, 1e7, 1e5):
        body.set_material(Material(young, 0.2, 1000.0, 20.0, damping_ratio=0.0))
        counts.append(world.stable_substeps(1 / 60))
        for _ in range(3):
            world.step(1 / 60)
    assert counts[1] > 5 * counts[0] == 5 * counts[2]
    assert not body.is_frozen
    assert len(world._context.substeps._estimates) == 1  # nothing is stored about replaced materials


@pytest.mark.parametrize(
    ("name", "wrong", "text"),
    [
        ("virial", SpringMaterial(1.0), " Material.*cannot change"),
        (
            "springs",
            Material(1e5, 0.2, 1000.0, damping_ratio=0.0),
            "SpringMaterial.*cannot change",
        ),
        ("virial", AnisotropicMaterial(WOOD, 1000.0, damping_ratio=0.0), "cannot change"),
        ("virial", Material(1e5 * np.ones(7), 0.2, 1000.0, damping_ratio=0.0), "7 values.*40"),
        (
            "virial",
            Material(1e5, 0.2, 1000.0, shear_modulus=1e4, damping_ratio=0.0),
            "has no shear_modulus",
        ),
        ("anisotropic", AnisotropicMaterial(WOOD, np.ones(7), damping_ratio=0.0), "7 values"),
        ("virial", "jelly", "got str"),
        ("virial", None, "got NoneType"),
    ],
)
def test_a_material_of_another_kind_is_refused(told, name, wrong, text):
    _, _, _, bodies = told
    body = bodies[name]
    before = body.material
    with pytest.raises(MaterialError, match=text):
        body.set_material(wrong)
    for damping in (-1.0, float("nan"), "much", np.ones(5)):
        with pytest.raises(MaterialError):
            body.set_damping(damping)
    assert body.material is before


def test_no_material_is_set_before_build(cube, jelly):
    world = bare_world()
    body = world.add_body(cube, jelly, position=(0, 0, 2))
    with pytest.raises(StateError, match="not built"):
        body.set_material(Material(2e5, 0.2, 1000.0, damping_ratio=0.0))
    assert body.material is jelly


def compiled_count():
    """How many kernels are compiled in this process, over all of their arguments."""
    count = 0
    for name, module in list(sys.modules.items()):
        if name.startswith("taichi_soft."):
            for kernel in vars(module).values():
                count += len(kernel._primal.compiled_kernels) if hasattr(kernel, "_primal") else 0
    return count


def control_everything(world, bodies, turn):
    """Every call there is, once, on every body."""
    frame = world.add_frame((0, 0, float(turn)))
    world.set_wind((1.0 + turn, 0, 0))
    world.set_force_field(lambda x, t: -0.1 * x)
    for name, body in bodies.items():
        body.set_material(KINDS[name][2 + turn % 2])
        body.set_damping(5.0 + turn)
        body.set_gravity_scale(0.5)
        body.set_linear_damping(1.0 + turn)
        body.set_sheltered(turn % 2 == 0)
        body.unpin()
        body.set_velocity((0, 0, 1.0), (0, turn, 0))
        body.teleport((3.0 * body.index, 0, 1.0 + turn), FRAME)
        body.apply_force((1, 0, 0))
        body.apply_impulse((0.1, 0, 0), [1, 2])
        body.apply_impulse_at_point((0.1, 0, 0), body.positions()[3], 0.3)
        body.pin([0])
        body.set_targets([0], body.positions()[:1] + 0.01)
    attachments = [body.attach([5 + turn], frame, two_way=True) for body in bodies.values()]
    grabs = [body.grab(0) for body in bodies.values()]
    world.apply_radial_impulse((0, 0, 0), 1.0, 5.0)
    for step in range(3):
        frame.move_to((0, 0, turn + 0.01 * step))
        for grab in grabs:
            grab.move(grab.point + np.array([0.01, 0, 0]))
        world.step(1 / 60, 16)
    loads = [(each.force, each.torque) for each in attachments]
    pulls = [grab.force for grab in grabs]
    for each in (*attachments, *grabs):
        each.release()
    world.set_wind(None)
    world.set_force_field(None)
    assert np.isfinite(loads).all()
    assert np.isfinite(pulls).all()
    return [body.positions().tobytes() for body in bodies.values()]


def test_nothing_is_compiled_after_a_first_use(told):
    _, _, world, bodies = told
    control_everything(world, bodies, 0)
    before = compiled_count()
    assert before > 20
    for turn in range(1, 4):
        control_everything(world, bodies, turn)
        assert not any(body.is_frozen for body in bodies.values())
    assert compiled_count() == before


@pytest.mark.guard
def test_the_same_calls_give_the_same_bits(told):
    stories = []
    for _ in range(2):
        world, bodies = build(2)
        stories.append([control_everything(world, bodies, turn) for turn in range(2)])
        del world, bodies
    assert stories[0] == stories[1]
