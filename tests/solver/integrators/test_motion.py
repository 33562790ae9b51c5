"""How forces become motion: closed formulas for falling and for small vibration, reversal, conservation.

Worlds compute in float32, so comparisons leave room for its last bits.
"""

import numpy as np
import pytest

from taichi_soft import Material, box, internal_forces, sphere, stable_step
from taichi_soft.elements.laws import element_model

pytestmark = pytest.mark.soak

CUBE = box((1.0, 1.0, 1.0), (1, 1, 1))
BALL = sphere(0.5, 2)
JELLY = Material(1e5, 0.25, 1000.0, damping_ratio=0.0)  # at nu = 1/4 the linear strain has an energy
INTEGRATORS = ("leapfrog", "lazy_leapfrog", "explicit_euler")
G = 9.80665


def masses(mesh, density=1000.0):
    """Return the vertex masses: a quarter of each adjacent tetrahedron's mass."""
    m = np.zeros(len(mesh.vertices))
    for tet in mesh.tets:
        a, b, c, d = mesh.vertices[tet]
        m[tet] += density * np.dot(b - a, np.cross(c - a, d - a)) / 24
    return m


def fastest_mode(mesh, material):
    """Highest w [1/s] and its shape (n, 3), from a dense stiffness by central differences of the forces."""
    count, step = mesh.vertices.size, 1e-6
    K = np.empty((count, count))
    for k in range(count):
        u = np.zeros(count)
        u[k] = step
        u = u.reshape(-1, 3)
        ends = [internal_forces(mesh, material, mesh.vertices + s * u) for s in (1, -1)]
        K[:, k] = (ends[1] - ends[0]).ravel() / (2 * step)
    root = np.sqrt(np.repeat(masses(mesh), 3))
    values, vectors = np.linalg.eigh((K + K.T) / 2 / np.outer(root, root))
    shape = (vectors[:, -1] / root).reshape(-1, 3)
    return np.sqrt(values[-1]), shape / np.abs(shape).max()


def random_motion(mesh, seed, speed=0.3):
    rng = np.random.default_rng(seed)
    return (
        rng.normal(size=3)
        + np.cross(rng.normal(size=3), mesh.vertices)
        + speed * rng.normal(size=mesh.vertices.shape)
    )


@pytest.mark.guard
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("substeps", [1, 3])
def test_free_fall_follows_the_sum_of_its_steps(flight, integrator, substeps):
    """z0 + v t - g t^2/2 exactly for leapfrog; n (n + 1) or n (n - 1) instead of n^2 for the other two."""
    dt, steps = 0.004, 60
    v0 = np.tile([0.3, -0.2, 1.0], (len(CUBE.vertices), 1))
    world, body = flight(CUBE, JELLY, v=v0, integrator=integrator, gravity=(0, 0, -G))
    for _ in range(steps):
        world.step(dt, substeps)
    n, h = steps * substeps, dt / substeps
    squares = {"leapfrog": n * n, "lazy_leapfrog": n * (n + 1), "explicit_euler": n * (n - 1)}[integrator]
    expected = CUBE.vertices + v0 * (n * h) - [0, 0, G * h * h * squares / 2]
    np.testing.assert_allclose(body.positions(), expected, atol=2e-5)
    np.testing.assert_allclose(body.velocities(), v0 - [0, 0, G * n * h], atol=2e-4)
    assert abs(G * h * h * n / 2) > 4e-3 / substeps  # what tells the three apart is not round-off


def test_leapfrog_falls_the_same_whatever_the_substep(flight):
    """The substep may also change during the fall: consecutive half steps fit together."""
    world, body = flight(CUBE, JELLY, gravity=(0, 0, -G))
    for dt, substeps in ((0.01, 2), (0.02, 5), (0.003, 1), (0.01, 8)) * 3:
        world.step(dt, substeps)
    t = 3 * 0.043
    np.testing.assert_allclose(body.positions(), CUBE.vertices - [0, 0, G * t * t / 2], atol=5e-6)
    np.testing.assert_allclose(body.velocities()[:, 2], -G * t, atol=5e-5)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_small_vibration_follows_the_integrators_own_closed_formula(flight, integrator):
    """A cube's fastest mode, w h = 0.2: cos(n theta) with sin(theta/2) = w h/2; or growing by 1 + i w h."""
    omega, shape = fastest_mode(CUBE, JELLY)
    h, steps, a = 0.2 / omega, 40, 1e-3
    world, body = flight(CUBE, JELLY, x=CUBE.vertices + a * shape, integrator=integrator)
    found, weight = [], masses(CUBE)[:, None] * shape
    weight /= np.sum(weight * shape)
    for _ in range(steps):
        world.step(h, 1)
        found.append(np.sum(weight * (body.positions() - CUBE.vertices)) / a)
    n, theta = np.arange(1, steps + 1), 2 * np.arcsin(0.1)
    expected = {
        "leapfrog": np.cos(n * theta),
        "lazy_leapfrog": np.cos((n + 0.5) * theta) / np.cos(theta / 2),
        "explicit_euler": ((1 + 0.2j) ** n).real,
    }[integrator]
    np.testing.assert_allclose(found, expected, atol=0.02)


def there_and_back(flight, integrator, mesh, steps, h, seed=0):
    """Run forth and, with velocities negated, back: gaps to the start in place and speed; how far it went."""
    v0 = random_motion(mesh, seed)
    world, body = flight(mesh, JELLY, v=v0, integrator=integrator)
    for _ in range(steps):
        world.step(h, 1)
    away = np.abs(body.positions() - mesh.vertices).max()
    body.set_motion(body.positions(), -body.velocities())
    for _ in range(steps):
        world.step(h, 1)
    return np.abs(body.positions() - mesh.vertices).max(), np.abs(body.velocities() + v0).max(), away


@pytest.mark.guard
def test_leapfrog_run_backwards_returns_to_its_start(flight):
    """Thesis section 3.5.2. Explicit Euler does not, by orders of magnitude."""
    h = 0.1 / fastest_mode(BALL, JELLY)[0]
    error, velocity_error, away = there_and_back(flight, "leapfrog", BALL, 200, h)
    euler_error, _, _ = there_and_back(flight, "explicit_euler", BALL, 200, h)
    assert away > 0.1
    assert error < 2e-5
    assert velocity_error < 2e-2
    assert euler_error > 100 * error


def test_reversal_holds_at_large_steps_too(flight):
    """At three quarters of the stable limit it is as exact: a property of the scheme, not of a small step."""
    h = 0.75 * stable_step(BALL, JELLY, element_model("virial")).limit
    error, _, away = there_and_back(flight, "leapfrog", BALL, 40, h, seed=1)
    assert away > 0.1
    assert error < 5e-5


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("options", [{}, {"strain": "exact", "flips": "recover"}], ids=["linear", "exact"])
@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_momentum_and_angular_momentum_are_conserved_in_flight(flight, integrator, options, damping):
    """Explicit Euler keeps the first only: it adds h^2 v x a of its own, but that sums up to little here."""
    material = Material(1e5, 0.25, 1000.0, damping, damping_ratio=0.0)
    v0 = random_motion(BALL, 2)
    m = masses(BALL)
    world, body = flight(BALL, material, v=v0, integrator=integrator, **options)
    h = 0.1 / fastest_mode(BALL, JELLY)[0]
    world.step(100 * h, 100)
    x, v = body.positions().astype(float), body.velocities().astype(float)
    assert np.abs(x - BALL.vertices).max() > 0.1
    np.testing.assert_allclose(m @ v, m @ v0, atol=1e-4 * np.linalg.norm(m @ v0))
    before = np.cross(BALL.vertices, m[:, None] * v0).sum(axis=0)
    after = np.cross(x, m[:, None] * v).sum(axis=0)
    bound = 0.05 if integrator == "explicit_euler" else 2e-4
    np.testing.assert_allclose(after, before, atol=bound * np.linalg.norm(before))


def energies(flight, integrator, material, steps, h, every, a=0.02):
    """Kinetic plus elastic energy of a cube that starts stretched, every so many steps; the start first."""
    rng = np.random.default_rng(4)
    x = CUBE.vertices + a * rng.normal(size=CUBE.vertices.shape)
    world, body = flight(CUBE, material, x=x, integrator=integrator)
    found = [body.kinetic_energy() + body.elastic_energy()]
    for _ in range(steps // every):
        world.step(every * h, every)
        found.append(body.kinetic_energy() + body.elastic_energy())
    return np.array(found)


def test_explicit_euler_gains_energy_and_leapfrog_does_not(flight):
    """Undamped: the energy of every mode of Euler grows by 1 + h^2 w^2 a step, that of leapfrog stays."""
    omega, _ = fastest_mode(CUBE, JELLY)
    h = 0.1 / omega
    euler = energies(flight, "explicit_euler", JELLY, 200, h, 20)
    assert (np.diff(euler) > 0).all()
    assert 2 * euler[0] < euler[-1] < 1.2 * euler[0] * (1 + h**2 * omega**2) ** 200
    for integrator in ("leapfrog", "lazy_leapfrog"):
        bounded = energies(flight, integrator, JELLY, 4000, h, 50)
        assert 0.85 * bounded[0] < bounded.min() < bounded.max() < 1.15 * bounded[0]


@pytest.mark.parametrize("integrator", ["leapfrog", "lazy_leapfrog"])
def test_a_little_damping_makes_vibration_die_away(flight, integrator):
    """Thesis section 6.4: very little damping stops the drift of undamped bodies."""
    h = 0.2 / fastest_mode(CUBE, JELLY)[0]
    damped = energies(flight, integrator, Material(1e5, 0.25, 1000.0, 20.0, damping_ratio=0.0), 3000, h, 300)
    assert (np.diff(damped) < 0).all()
    assert damped[-1] < 0.05 * damped[0]


def test_edge_damping_lets_a_spinning_body_spin(flight):
    """Damping against the tetrahedron's mean velocity takes the spin away instead (thesis section 6.4)."""
    spin = np.cross([0, 0, 0.5], CUBE.vertices)
    m = masses(CUBE)
    start = np.cross(CUBE.vertices, m[:, None] * spin).sum(axis=0)[2]
    kept = {}
    for model in ("edge", "tet_mean"):
        world, body = flight(
            CUBE, Material(1e5, 0.25, 1000.0, 200.0, damping_ratio=0.0), v=spin, damping_model=model
        )
        for _ in range(100):
            world.step(0.02)
        x, v = body.positions().astype(float), body.velocities().astype(float)
        kept[model] = np.cross(x, m[:, None] * v).sum(axis=0)[2] / start
    assert kept["edge"] == pytest.approx(1, abs=2e-3)
    assert kept["tet_mean"] < 0.5


@pytest.mark.parametrize("integrator", ["leapfrog", "lazy_leapfrog"])
def test_a_body_at_rest_stays_at_rest(flight, integrator):
    world, body = flight(BALL, Material(1e5, 0.25, 1000.0, 20.0, damping_ratio=0.0), integrator=integrator)
    for _ in range(20):
        world.step(0.01)
    np.testing.assert_allclose(body.positions(), BALL.vertices, atol=1e-6)
    assert np.abs(body.velocities()).max() < 1e-4


def test_halving_the_substep_quarters_leapfrogs_error_and_halves_eulers(flight):
    """Second and first order, against a run of 64 times as many substeps."""
    _, shape = fastest_mode(CUBE, JELLY)
    dt = 0.02

    def end(integrator, substeps):
        world, body = flight(CUBE, JELLY, x=CUBE.vertices + 0.1 * shape, integrator=integrator)
        world.step(dt, substeps)
        return body.positions().astype(float)

    exact = end("leapfrog", 512)
    for integrator, ratio in (("leapfrog", 4), ("explicit_euler", 2)):
        coarse, fine = (np.linalg.norm(end(integrator, n) - exact) for n in (8, 16))
        assert coarse / fine == pytest.approx(ratio, rel=0.25)
