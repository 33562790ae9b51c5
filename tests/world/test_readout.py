"""What a body tells about itself, against numpy and against analytic motion."""

import numpy as np
import pytest

from taichi_soft import Material, TetMesh, box, sphere

FREE = {"gravity": (0, 0, 0), "floor": None}


def quarter_masses(mesh, density):
    """Compute the vertex masses tetrahedron by tetrahedron in Python."""
    masses = np.zeros(len(mesh.vertices))
    for t, (a, b, c, d) in enumerate(mesh.tets):
        x = mesh.vertices
        volume = np.dot(x[b] - x[a], np.cross(x[c] - x[a], x[d] - x[a])) / 6
        masses[[a, b, c, d]] += np.broadcast_to(density, len(mesh.tets))[t] * volume / 4
    return masses


def shuffled(mesh, seed=3):
    """The same body with vertices and tetrahedra numbered otherwise; `place[i]` is old vertex i's number."""
    random = np.random.default_rng(seed)
    place = random.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[place] = mesh.vertices
    return TetMesh(vertices, random.permutation(place[mesh.tets])), place


@pytest.mark.parametrize("as_quaternion", [False, True])
def test_a_body_starts_where_it_was_put(solo, cube, jelly, turned, as_quaternion):
    rotation = turned
    if as_quaternion:
        w = np.sqrt(1 + np.trace(turned)) / 2
        x, y, z = (
            (turned[2, 1] - turned[1, 2]) / (4 * w),
            (turned[0, 2] - turned[2, 0]) / (4 * w),
            (turned[1, 0] - turned[0, 1]) / (4 * w),
        )
        rotation = (x, y, z, w)
    _, body = solo(cube, jelly, position=(3, -2, 5), rotation=rotation, velocity=(1, 2, -3))
    expected = np.array([turned @ vertex + [3, -2, 5] for vertex in cube.vertices])
    np.testing.assert_allclose(body.positions(), expected, atol=2e-6)
    np.testing.assert_allclose(body.velocities(), np.tile([1, 2, -3], (27, 1)), atol=1e-6)


def test_a_quarter_turn_about_z_takes_x_to_y(solo, cube, jelly):
    _, body = solo(cube, jelly, rotation=(0, 0, np.sqrt(0.5), np.sqrt(0.5)), position=(0, 0, 2))
    expected = cube.vertices[:, [1, 0, 2]] * [-1, 1, 1] + [0, 0, 2]
    np.testing.assert_allclose(body.positions(), expected, atol=1e-6)


def test_a_meshes_numbering_does_not_matter(solo, jelly):
    mesh = sphere(0.5, 3)
    other, place = shuffled(mesh)
    runs = []
    for shape in (mesh, other):
        world, body = solo(shape, jelly, position=(0, 0, 0.7), velocity=(1, 0, 0))
        for _ in range(60):
            world.step(1 / 60, 6)
        runs.append((body.positions(), body.velocities(), body.volumes()))
    np.testing.assert_allclose(runs[1][0][place], runs[0][0], atol=2e-3)
    np.testing.assert_allclose(runs[1][1][place], runs[0][1], atol=5e-2)
    assert runs[1][2].sum() == pytest.approx(runs[0][2].sum(), rel=1e-3)


def test_motion_that_is_set_comes_back_in_the_callers_order(solo, jelly):
    mesh, _ = shuffled(sphere(0.5, 3))
    _, body = solo(mesh, jelly)
    random = np.random.default_rng(0)
    x, v = random.normal(size=(2, body.vertex_count, 3)).astype(np.float32)
    body.set_motion(x, v)
    assert body.positions().tobytes() == x.tobytes()
    assert body.velocities().tobytes() == v.tobytes()


def test_masses_are_quarters_of_the_neighbours(solo):
    mesh = sphere(0.7, 3)
    density = np.linspace(500, 1500, len(mesh.tets))
    _, body = solo(mesh, Material(1e5, 0.2, density, damping_ratio=0.0))
    np.testing.assert_allclose(body.masses, quarter_masses(mesh, density), rtol=1e-12)
    assert body.masses.sum() == pytest.approx((mesh.volumes * density).sum())


def test_sums_over_particles(solo, cube, jelly):
    _, body = solo(cube, jelly, {"gravity": (1.0, -2.0, -5.0)})
    random = np.random.default_rng(1)
    x = (cube.vertices + random.normal(size=cube.vertices.shape) * 0.05).astype(np.float32).astype(float)
    v = random.normal(size=x.shape).astype(np.float32).astype(float)
    body.set_motion(x, v)
    m = quarter_masses(cube, 1000.0)
    np.testing.assert_allclose(body.momentum(), sum(m[i] * v[i] for i in range(27)), rtol=1e-9)
    np.testing.assert_allclose(
        body.angular_momentum(), sum(m[i] * np.cross(x[i], v[i]) for i in range(27)), rtol=1e-9
    )
    np.testing.assert_allclose(
        body.center_of_mass(), sum(m[i] * x[i] for i in range(27)) / m.sum(), rtol=1e-9
    )
    assert body.kinetic_energy() == pytest.approx(sum(m[i] * v[i] @ v[i] / 2 for i in range(27)))
    height = -sum(m[i] * x[i] @ np.array([1.0, -2.0, -5.0]) for i in range(27))
    assert body.gravitational_energy() == pytest.approx(height)


def test_uniform_deformation_has_the_strain_stress_and_energy_of_the_book(solo, cube, jelly, turned):
    stretch = np.array([[1.1, 0.05, 0.0], [0.05, 0.95, 0.02], [0.0, 0.02, 1.2]])
    F = turned @ stretch
    _, body = solo(cube, jelly)
    body.set_motion(cube.vertices @ F.T, np.zeros_like(cube.vertices))
    strain = (F @ F.T - np.eye(3)) / 2
    np.testing.assert_allclose(body.strains(), np.tile(strain, (40, 1, 1)), atol=1e-5)
    mu, lame = 1e5 / (2 * 1.2), 1e5 * 0.2 / (1.2 * 0.6)
    stress = 2 * mu * strain + lame * np.trace(strain) * np.eye(3)
    assert body.elastic_energy() == pytest.approx(0.5 * np.sum(stress * strain), rel=1e-4)
    s = np.linalg.eigvalsh(stress)
    mises = np.sqrt(((s[0] - s[1]) ** 2 + (s[1] - s[2]) ** 2 + (s[2] - s[0]) ** 2) / 2)
    np.testing.assert_allclose(body.vertex_stress(), np.full(27, mises), rtol=1e-4)
    assert body.volume() == pytest.approx(np.linalg.det(F), rel=1e-5)
    np.testing.assert_allclose(body.volumes(), cube.volumes * np.linalg.det(F), rtol=1e-4)


def test_flips_are_counted(solo, cube, jelly):
    _, body = solo(cube, jelly)
    assert body.flipped_count() == 0
    assert body.volume() == pytest.approx(1.0)
    body.set_motion(cube.vertices * [1, 1, -1], np.zeros_like(cube.vertices))
    assert body.flipped_count() == 40
    assert body.volume() == pytest.approx(-1.0)
    x = np.array(cube.vertices)
    corner = int(np.argmax(x.sum(axis=1)))
    x[corner] = -x[corner]  # through the whole cube: its tetrahedra turn inside out
    body.set_motion(x, np.zeros_like(x))
    assert body.flipped_count() == (cube.tets == corner).any(axis=1).sum()


def test_free_fall(solo, cube, jelly, turned):
    """Leapfrog makes no error on a parabola, in any number of substeps."""
    gravity = np.array([0.5, -1.0, -3.0])
    world, body = solo(
        cube,
        jelly,
        {"gravity": gravity, "floor": None},
        rotation=turned,
        velocity=(1, 2, 3),
        position=(0, 0, 9),
    )
    start = body.positions().astype(float)
    for substeps in (1, 4, 9, 2) * 10:
        world.step(1 / 60, substeps)
    t = 40 / 60
    assert world.time == pytest.approx(t)
    assert world.step_count == 40
    v = np.array([1, 2, 3]) + gravity * t
    np.testing.assert_allclose(
        body.positions(), start + np.array([1, 2, 3]) * t + gravity * t * t / 2, atol=2e-4
    )
    np.testing.assert_allclose(body.velocities(), np.tile(v, (27, 1)), atol=5e-3)
    np.testing.assert_allclose(body.momentum(), 1000 * v, rtol=1e-4)
    assert body.kinetic_energy() == pytest.approx(500 * v @ v, rel=1e-4)
    total = body.kinetic_energy() + body.gravitational_energy()
    assert total == pytest.approx(500 * 14 + -1000 * gravity @ [0, 0, 9], rel=1e-3)


def test_no_gravity_keeps_a_resting_body_where_it_is(solo, cube, jelly, turned):
    world, body = solo(cube, jelly, FREE, rotation=turned, position=(0, 0, 1))
    before = body.positions()
    for _ in range(100):
        world.step(1 / 60, 4)
    np.testing.assert_allclose(body.positions(), before, atol=1e-5)


def test_a_thrown_and_spinning_body_keeps_its_momenta(solo, jelly):
    mesh = sphere(0.5, 3)
    world, body = solo(mesh, jelly, FREE)
    spin, speed = np.array([0.5, 1.0, 2.0]), np.array([1.0, 0.0, 0.5])
    body.set_motion(mesh.vertices, np.cross(spin, mesh.vertices) + speed)
    momentum, angular = body.momentum(), body.angular_momentum()
    for _ in range(120):
        world.step(1 / 60, 6)
    np.testing.assert_allclose(body.momentum(), momentum, atol=1e-3 * np.linalg.norm(momentum))
    np.testing.assert_allclose(body.angular_momentum(), angular, atol=1e-2 * np.linalg.norm(angular))
    center = body.center_of_mass()
    np.testing.assert_allclose(center, speed * 2.0, atol=1e-3)


def test_a_small_vibration_keeps_its_energy_without_damping(solo, cube):
    """For small strain the stress is that of the energy: what leapfrog conserves but for ripples."""
    world, body = solo(cube, Material(1e5, 0.25, 1000.0, damping_ratio=0.0), FREE)
    body.set_motion(cube.vertices * [1.002, 0.999, 0.999], np.zeros_like(cube.vertices))
    start = body.elastic_energy()
    totals = []
    for _ in range(120):
        world.step(1 / 240, 4)
        totals.append(body.elastic_energy() + body.kinetic_energy())
    assert np.ptp(totals) < 0.05 * start
    assert np.mean(totals) == pytest.approx(start, rel=0.03)


def test_damping_takes_energy_and_no_momentum(solo, cube, jelly):
    world, body = solo(cube, jelly, FREE)
    body.set_motion(cube.vertices * [1.1, 0.95, 0.95], np.tile([1.0, 0, 0], (27, 1)))
    start = body.elastic_energy()
    for _ in range(600):
        world.step(1 / 60, 6)
    assert body.elastic_energy() < 1e-2 * start
    np.testing.assert_allclose(body.momentum(), [1000, 0, 0], atol=1.0)


def test_a_number_per_tetrahedron_acts_on_that_tetrahedron(solo):
    """One substep of Euler from rest turns forces into velocities, here of a bar of two halves."""
    mesh = box((2.0, 1.0, 1.0), (4, 2, 2))
    right = mesh.vertices[mesh.tets].mean(axis=1)[:, 0] > 0
    young = np.where(right, 4e5, 1e5)
    world, body = solo(
        mesh,
        Material(young, 0.2, 1000.0, damping_ratio=0.0),
        {**FREE, "integrator": "explicit_euler"},
        strain="linear",
    )
    x = mesh.vertices * [1.05, 1.0, 1.0]
    body.set_motion(x, np.zeros_like(x))
    world.step(1e-3, 1)
    pull = body.masses[:, None] * body.velocities()
    ends = [np.abs(pull[mesh.vertices[:, 0] == end, 0]).sum() for end in (-1.0, 1.0)]
    assert ends[1] == pytest.approx(4 * ends[0], rel=1e-3)
    # Uniaxial strain, a face of 1 m^2 that keeps its area: force = (lambda + 2 mu) * strain.
    strain = (1.05**2 - 1) / 2
    modulus = 1e5 * (1 - 0.2) / (1.2 * 0.6)
    assert ends[0] == pytest.approx(modulus * strain * 1e-3, rel=0.02)


def test_an_array_of_equal_numbers_is_that_number(solo, cube, jelly):
    arrays = Material(*(np.full(40, value) for value in (1e5, 0.2, 1000.0, 20.0)), damping_ratio=0.0)
    hashes = []
    for material in (jelly, arrays):
        world, body = solo(cube, material, position=(0, 0, 0.6))
        for _ in range(60):
            world.step(1 / 60, 6)
        hashes.append(body.positions().tobytes())
    assert hashes[0] == hashes[1]


def test_the_callers_buffer_is_filled(solo, cube, jelly):
    world, body = solo(cube, jelly, position=(0, 0, 1))
    world.step(1 / 60)
    out = np.empty((27, 3), dtype=np.float32)
    assert body.positions(out) is out
    assert body.positions(out=out) is out
    assert out.tobytes() == body.positions().tobytes()
    assert body.positions() is not body.positions()


def test_positions_between_two_steps(solo, cube, jelly):
    world, body = solo(cube, jelly, position=(0, 0, 1))
    for _ in range(10):
        before = body.positions()
        world.step(1 / 60)
    now = body.positions()
    for alpha in (0.0, 0.25, 0.5, 0.99, 1.0):
        expected = (1 - alpha) * before.astype(float) + alpha * now.astype(float)
        np.testing.assert_allclose(world.read_positions(body, alpha), expected, atol=1e-6)
    assert world.read_positions(body, 0.0).tobytes() == before.tobytes()
    assert world.read_positions(body, 1.0).tobytes() == now.tobytes()


def test_a_body_at_rest_has_no_velocity(solo, cube):
    """The floor carries the weight: gravity alone must not show in the velocities of the soles."""
    world, body = solo(cube, Material(1e5, 0.2, 1000.0, 300.0, damping_ratio=0.0), position=(0, 0, 0.55))
    for _ in range(900):
        world.step(1 / 60)
    before = body.positions().astype(float)
    world.step(1 / 60)
    assert np.abs(body.positions() - before).max() < 1e-5
    assert np.abs(body.momentum()).max() < 0.5
    assert body.kinetic_energy() < 1e-3
