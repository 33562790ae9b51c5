"""The damping ratio of a material is that of the first mode of whatever is made of it.

The oracle: K assembled in float64 from the shape functions of linear tetrahedra, or by differences of forces,
its first mode from SciPy, and the logarithmic decrement of that mode in a world.
"""

import numpy as np
import pytest
import trimesh
from mode_oracle import assembled_stiffness, first_mode, lumped_masses
from random_meshes import scattered

from lab.drop_test.robustness.foreign_meshes import FOREIGN_MESHES
from taichi_soft import Material, SoftBodyAsset, TetMesh, beam, box, internal_forces, sphere
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.first_mode import first_frequency
from taichi_soft.core.errors import MaterialError
from taichi_soft.elements.laws import element_model, fit_model
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

YOUNG, POISSON, DENSITY = 1e5, 0.3, 1000.0
BALL = sphere(1.0, 6)
MESHES = {
    "540 tetrahedra": sphere(1.0, 3),
    "4,320 tetrahedra": BALL,
    "54,880 tetrahedra": sphere(1.0, 14),
    "a hundredth": BALL.scaled(0.01),
    "a hundred times": BALL.scaled(100.0),
    "irregular": scattered(350, 5),
    "irregular and long": scattered(250, 6, (3.0, 0.6, 0.6)),
}


def measured_ratio(mesh, mass, omega, mode, periods=2.0, **options):
    """Return the damping ratio of the first mode, from the decay of its amplitude."""
    ratio = options.pop("damping_ratio", 0.05)
    integrator = options.pop("integrator", "leapfrog")
    world = bare_world(gravity=(0, 0, 0), floor=None, integrator=integrator)
    body = world.add_body(mesh, Material(YOUNG, POISSON, DENSITY, damping_ratio=ratio), **options)
    world.build()
    size = float(np.ptp(mesh.vertices, axis=0).max())
    swing = 1e-3 * size / np.abs(mode).max()
    body.set_motion(mesh.vertices, swing * omega * mode)
    dt, count = 2 * np.pi / omega / 40, int(40 * periods)

    def amplitude():
        u, v = body.positions() - mesh.vertices, body.velocities().astype(float)
        return np.hypot(*(float((mass[:, None] * mode * rows).sum()) for rows in (u, v / omega)))

    before = amplitude()
    for _ in range(count):
        world.step(dt)
    return -np.log(amplitude() / before) / (omega * dt * count)


@pytest.mark.parametrize("name", MESHES)
def test_the_first_mode_fades_by_the_ratio_whatever_the_mesh_and_its_size(name):
    mesh = MESHES[name]
    mass = lumped_masses(mesh, DENSITY)
    omega, mode = first_mode(assembled_stiffness(mesh, YOUNG, POISSON), mass)
    assert measured_ratio(mesh, mass, omega, mode) == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("options", [{"law": "virial"}, {"law": "springs"}, {"integrator": "implicit_euler"}])
def test_other_laws_and_implicit_euler_fade_by_it_too(options):
    """Beside what the integrator itself takes, which a run without the ratio tells."""
    mesh = sphere(1.0, 2)
    law = options.get("law", "neo_hookean")
    material = Material(YOUNG, POISSON, DENSITY)
    body = BodyDescription(mesh, material, fit_model(element_model(law), mesh, material))
    omega, mode = first_mode(differences(mesh, law), body.masses)
    with_it = measured_ratio(mesh, body.masses, omega, mode, **options)
    without = measured_ratio(mesh, body.masses, omega, mode, damping_ratio=0.0, **options)
    assert with_it - without == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 1), (2, 2, 1), (2, 2, 2), (3, 1, 1)])
def test_a_box_of_few_tetrahedra_has_the_frequency_of_its_stiffness_matrix(cells):
    mesh = box((1.0, 0.8, 0.6), cells)
    require_first_frequency(mesh)


def test_a_ball_of_twenty_tetrahedra_has_the_frequency_of_its_stiffness_matrix():
    require_first_frequency(sphere(0.5, 1))


def require_first_frequency(mesh):
    material = Material(YOUNG, POISSON, DENSITY)
    body = BodyDescription(mesh, material, fit_model(element_model("neo_hookean"), mesh, material))
    omega, _ = first_mode(assembled_stiffness(mesh, YOUNG, POISSON), lumped_masses(mesh, DENSITY))
    assert first_frequency(body) == pytest.approx(omega, rel=3e-3)


def test_a_body_of_separate_parts_has_the_frequency_of_its_slowest_part():
    """Rigid motion of one part against another strains nothing: its frequency is zero, and damps nothing."""
    parts = [box((1.0, 0.3, 0.2), (6, 2, 2)), sphere(0.3, 2), box((0.1, 0.1, 0.1), (1, 1, 1))]
    places = [(0.0, 0.0, 0.0), (0.0, 2.0, 0.0), (90.0, 0.0, 0.0)]
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    mesh = TetMesh(
        np.concatenate([part.vertices + np.array(place) for part, place in zip(parts, places, strict=True)]),
        np.concatenate([part.tets + shift for part, shift in zip(parts, first, strict=False)]),
    )
    slowest = min(
        first_mode(assembled_stiffness(part, YOUNG, POISSON), lumped_masses(part, DENSITY))[0]
        for part in parts
    )
    asset = SoftBodyAsset(mesh, Material(YOUNG, POISSON, DENSITY))
    assert 0.999 * slowest < asset.first_frequency < 1.12 * slowest
    assert 0.999 * slowest < asset.guessed_frequency


def differences(mesh, law):
    """Stiffness at rest by differences of the forces, (3n, 3n)."""
    material, count = Material(YOUNG, POISSON, DENSITY), mesh.vertices.size
    K = np.empty((count, count))
    for k in range(count):
        u = np.zeros(count)
        u[k] = 1e-6
        ends = [
            internal_forces(mesh, material, mesh.vertices + s * u.reshape(-1, 3), law=law) for s in (1, -1)
        ]
        K[:, k] = (ends[1] - ends[0]).ravel() / 2e-6
    return (K + K.T) / 2


def pudding_in_space():
    """A world and a body whose cage has light vertices at its rim."""
    outline = np.array([(0, 0), (0.5, 0), (0.52, 0.05), (0.4, 0.45), (0.36, 0.52), (0.28, 0.55), (0, 0.55)])
    pudding = trimesh.creation.revolve(outline, sections=64)
    asset = SoftBodyAsset.from_surface(pudding, Material(344500.0, 0.4, 300.0, damping_ratio=0.0988), cells=9)
    world = bare_world(gravity=(0, 0, 0), floor=None)
    body = world.add_body(asset)
    world.build()
    return world, body


@pytest.mark.guard
def test_a_light_vertex_fades_with_the_rest_however_rarely_damping_acts():
    """Damping acts only every few substeps, and the outermost vertices of this cage vibrate in about three.

    If damping used velocities half a substep away from the positions, it would amplify these vibrations.
    """
    world, body = pudding_in_space()
    rest = body.mesh.vertices
    body.set_motion(rest * np.array([1.01, 1, 1]), 0 * rest)
    fastest = []
    for _ in range(4):
        for _ in range(100):
            world.step(0.01)
        fastest.append(float(np.abs(body.velocities()).max()))
    assert (np.diff(fastest) < 0).all()
    assert fastest[-1] < 0.15


def test_no_mode_stands_still_whenever_it_would_be_damped():
    """A mode whose phase advances by 180 degrees between two dampings could escape each damping.

    This happens if the mode has zero velocity at one of these times.
    """
    world, body = pudding_in_space()
    rest = body.mesh.vertices
    body.set_motion(rest, 0.1 * np.random.default_rng(1).normal(size=rest.shape))
    for _ in range(120):
        world.step(0.01, substeps=20)
    mass = body.masses[:, None]
    arms, moving = rest - (mass * rest).sum(0) / mass.sum(), body.velocities().astype(float)
    moving -= (mass * moving).sum(0) / mass.sum()
    inertia = (mass * (arms**2)).sum() * np.eye(3) - (mass * arms).T @ arms
    spin = np.linalg.solve(inertia, np.cross(arms, mass * moving).sum(0))
    assert np.abs(moving - np.cross(spin, arms)).max() < 0.01


@pytest.mark.guard
@pytest.mark.parametrize("schedule", ["per_body", "flat"])
def test_damping_however_large_leaves_momentum_and_spin_and_gives_no_energy_by_the_same_substeps(schedule):
    """Nothing is retried here: a substep that damping makes unstable would show."""
    mesh = sphere(0.5, 2)
    found = {}
    for ratio in (0.0, 0.3, 1.0, 1000.0):
        world = bare_world(gravity=(0, 0, 0), floor=None, schedule=schedule, retries=0)
        body = world.add_body(mesh, Material(YOUNG, POISSON, DENSITY, damping_ratio=ratio))
        world.build()
        found[ratio] = world.stable_substeps(1 / 60)
        noise = 0.3 * np.random.default_rng(1).normal(size=mesh.vertices.shape)
        spin = np.cross((1.0, 3.0, -2.0), mesh.vertices)
        body.set_motion(mesh.vertices, noise + spin + np.array([30.0, -20, 10]))
        mass = body.masses[:, None]

        def budget(body=body, mass=mass):
            x, v = body.positions().astype(float), body.velocities().astype(float)
            x -= (mass * x).sum(axis=0) / mass.sum()
            return (mass * v).sum(axis=0), (mass * np.cross(x, v)).sum(axis=0)

        def energy(body=body):
            return body.kinetic_energy() + body.elastic_energy()

        before, energies = budget(), [energy()]
        for _ in range(120):
            world.step(1 / 60)
            energies.append(energy())
        after = budget()
        assert max(energies) < (1 + 1e-3) * energies[0]
        for first, last in zip(before, after, strict=True):
            np.testing.assert_allclose(last, first, atol=2e-4 * np.linalg.norm(first))
        assert not body.is_frozen
    assert len(set(found.values())) == 1


def test_the_first_frequency_is_that_of_the_sparse_eigenproblem_from_above():
    for mesh in (
        sphere(0.5, 3),
        beam(2.0, 0.2, 0.2, 2),
        scattered(300, 7),
        scattered(200, 8, (2.0, 0.3, 0.3)),
    ):
        material = Material(YOUNG, POISSON, DENSITY)
        body = BodyDescription(mesh, material, fit_model(element_model("virial"), mesh, material))
        mass = lumped_masses(mesh, DENSITY)
        omega, _ = first_mode(assembled_stiffness(mesh, YOUNG, POISSON), mass)
        assert 0.999 * omega < first_frequency(body) < 1.12 * omega


def test_the_first_frequency_of_slivers_letters_plates_and_rods_is_too_high_by_less_than_a_fifth():
    for name, make in FOREIGN_MESHES.items():
        mesh, material = make(), Material(YOUNG, POISSON, DENSITY)
        body = BodyDescription(mesh, material, fit_model(element_model("virial"), mesh, material))
        mass = lumped_masses(mesh, DENSITY)
        omega, _ = first_mode(assembled_stiffness(mesh, YOUNG, POISSON), mass)
        assert 0.999 * omega < first_frequency(body) < 1.2 * omega, name


def test_a_material_set_later_fades_as_if_the_body_had_been_made_of_it():
    mesh = sphere(0.5, 2)
    stiffer = Material(4 * YOUNG, POISSON, DENSITY / 2, damping_ratio=0.1)
    left = []
    for first in (stiffer, Material(YOUNG, POISSON, DENSITY, damping_ratio=0.0)):
        world = bare_world(gravity=(0, 0, 0), floor=None)
        body = world.add_body(mesh, first)
        world.build()
        body.set_material(stiffer)
        stretch = 1e-3 * mesh.vertices * (1.0, -0.5, -0.5)
        body.set_motion(mesh.vertices, 40.0 * stretch)
        energies = []
        for _ in range(30):
            world.step(1 / 60, 8)
            energies.append(body.kinetic_energy() + body.elastic_energy())
        left.append(energies[-1] / energies[0])
    assert left[0] < 0.5
    assert left[1] == pytest.approx(left[0], rel=0.05)


@pytest.mark.parametrize("ratio", [-0.1, np.nan, np.inf, 1e9, "much", [0.1, 0.1], True])
def test_what_is_no_ratio_is_refused(ratio):
    with pytest.raises(MaterialError, match="damping_ratio"):
        Material(YOUNG, POISSON, DENSITY, damping_ratio=ratio)


def test_a_ratio_is_not_zero_where_nothing_is_said():
    assert Material(YOUNG, POISSON, DENSITY).damping_ratio > 0


@pytest.mark.parametrize("ratio", [0.3, 1.0, 1000.0])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"schedule": "flat"},
        {"integrator": "implicit_euler"},
        {"collider_room": 1},
        {"soft_contact": True},
    ],
    ids=["floor", "flat", "implicit", "colliders", "soft"],
)
def test_what_lies_still_is_not_moved_by_its_damping(options, ratio):
    """Nothing moves any more after a pile, or two blocks side by side, have come to rest."""
    world = bare_world(**options)
    is_pile = "soft_contact" in options
    for i in range(2):
        place = (0, 0, 0.255 + 0.51 * i) if is_pile else (i, 0, 0.255)
        block = box((0.5, 0.5, 0.5), (3, 3, 3))
        world.add_body(block, Material(3e5, 0.3, 500.0, damping_ratio=ratio), position=place)
    world.build()
    for _ in range(360):
        world.step(1 / 60)
    fastest = 0.0
    for _ in range(30):
        world.step(1 / 60)
        fastest = max(fastest, *(np.abs(body.velocities()).max() for body in world.bodies))
    assert fastest < 1e-3
