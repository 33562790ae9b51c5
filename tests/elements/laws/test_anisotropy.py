"""Anisotropic tetrahedra, compared with the equations in NumPy, for stretched cubes and rotated cubes."""

import force_oracle as oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import (
    AnisotropicMaterial,
    Material,
    Stiffness,
    beam,
    box,
    force_gradient,
    internal_forces,
    sphere,
    stable_step,
)
from taichi_soft.elements.laws import element_model
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

STVK = ("st_venant_kirchhoff", None, None)
# "face" has the same forces for a stress as "virial" (test_stress_to_forces), so one mode is enough.
MODES = [*(mode for mode in oracle.MODES if mode[0] == "virial"), ("face", "exact", "recover"), STVK]
EACH_MODE = pytest.mark.parametrize(
    ("law", "strain", "flips"), MODES, ids=["-".join(filter(None, m)) for m in MODES]
)
seeds = st.integers(0, 2**32 - 1)
YOUNG, POISSON, SHEAR = (8e5, 3e5, 1e5), (0.25, 0.3, 0.35), (5e4, 1e5, 2e5)
WOOD = Stiffness.orthotropic(YOUNG, POISSON, SHEAR)
I3 = np.eye(3)
PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def any_material(mesh, rng, damping=0.0):
    """Make a material without any symmetry, with another frame in every tetrahedron."""
    root = rng.normal(size=(6, 6))
    frames = np.stack([oracle.rotation(rng) for _ in mesh.tets])
    return AnisotropicMaterial(
        Stiffness(1e5 * (root @ root.T + I3.trace() * np.eye(6))), 1000.0, damping, frames, damping_ratio=0.0
    )


def stress_in(frame, matrix, strain):
    """Hooke's law in the material's axes, one component after the other (eq. 2.25 in Voigt's order)."""
    turned = frame.T @ strain @ frame
    row = [turned[a, b] * (1 if a == b else 2) for a, b in PAIRS]
    stress = np.zeros((3, 3))
    for (a, b), value in zip(PAIRS, matrix @ row, strict=True):
        stress[a, b] = stress[b, a] = value
    return frame @ stress @ frame.T


def mean_wave_modulus(matrix):
    """Return the mean of n n : C : n n over all directions n [Pa].

    The quadrature is exact for fourth powers: Lebedev's 14 points, along the axes and the diagonals of a
    cube.
    """
    axes, diagonals = np.eye(3), np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]) / np.sqrt(3)
    along = lambda n: n @ stress_in(I3, matrix, np.outer(n, n)) @ n  # noqa: E731
    return sum(map(along, axes)) * 2 / 15 + sum(map(along, diagonals)) * 3 / 20


def forces_by_numpy(mesh, material, x, law, strain, flips):
    forces = np.zeros_like(x)
    for tet, frame in zip(mesh.tets, material.frame, strict=True):
        corners = x[tet]
        F = oracle.deformation(mesh.vertices[tet], corners)
        hooke = lambda eps, frame=frame: stress_in(frame, material.stiffness.matrix, eps)  # noqa: E731
        if law == "st_venant_kirchhoff":
            inverse = np.linalg.inv((mesh.vertices[tet][1:] - mesh.vertices[tet][0]).T)
            rows = np.vstack([-inverse.sum(axis=0), inverse])
            volume = abs(oracle.signed_volume(mesh.vertices[tet]))
            forces[tet] -= volume * rows @ (F @ hooke((F.T @ F - I3) / 2)).T
            continue
        flipped = np.linalg.det(F) < 0
        if flipped and flips == "recover":
            modulus = mean_wave_modulus(material.stiffness.matrix)
            forces[tet] += oracle.recovering_forces(mesh.vertices[tet], corners, modulus)
            continue
        left, stretches, right = np.linalg.svd(F)
        strains = (stretches**2 - 1) / 2 if strain == "linear" else stretches - 1
        sigma = left @ right @ hooke((right.T * strains) @ right) @ right.T @ left.T
        areas = oracle.area_vectors(corners) * (-1 if flipped and flips == "tolerant" else 1)
        forces[tet] += areas @ sigma / 3
    return forces


@pytest.mark.guard
@EACH_MODE
@settings(max_examples=4)
@given(seed=seeds, name=st.sampled_from(["tet", "sphere"]), amount=st.sampled_from([0.01, 0.2, 0.6, 3.0]))
def test_forces_equal_those_of_the_equations_in_numpy(law, strain, flips, seed, name, amount):
    """The tetrahedra include inverted ones. The forces exert no total force and no torque."""
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES[name]
    material = any_material(mesh, rng)
    x = oracle.shaken(mesh, rng, amount) @ oracle.rotation(rng)
    forces = internal_forces(mesh, material, x, law=law, strain=strain, flips=flips)
    expected = forces_by_numpy(mesh, material, x, law, strain, flips)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-10 * scale)
    np.testing.assert_allclose(forces.sum(axis=0), 0, atol=1e-10 * scale * len(x))
    np.testing.assert_allclose(
        np.cross(x, forces).sum(axis=0), 0, atol=1e-9 * scale * np.abs(x).max() * len(x)
    )


@EACH_MODE
@settings(max_examples=4)
@given(seed=seeds, nu=st.floats(-0.9, 0.49), amount=st.sampled_from([0.01, 0.3, 2.0]))
def test_an_isotropic_stiffness_gives_the_isotropic_forces_to_round_off(law, strain, flips, seed, nu, amount):
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES["sphere"]
    frames = np.stack([oracle.rotation(rng) for _ in mesh.tets])
    turned = AnisotropicMaterial(Stiffness.isotropic(2e5, nu), 1000.0, frame=frames, damping_ratio=0.0)
    x = oracle.shaken(mesh, rng, amount)
    plain, found = (
        internal_forces(mesh, material, x, law=law, strain=strain, flips=flips)
        for material in (Material(2e5, nu, 1000.0, damping_ratio=0.0), turned)
    )
    scale = np.abs(plain).max() + 2e5 * mesh.edge_lengths.max() ** 2 * 1e-3
    np.testing.assert_allclose(found, plain, rtol=0, atol=1e-12 * scale)


@EACH_MODE
def test_turning_body_and_frame_together_turns_the_forces(law, strain, flips):
    """Forces also rotate if only the deformed body is rotated: a material has no direction in space."""
    rng = np.random.default_rng(7)
    mesh = sphere(0.7, 1)
    material = any_material(mesh, rng)
    x = oracle.shaken(mesh, rng, 0.4)
    options = {"law": law, "strain": strain, "flips": flips}
    forces = internal_forces(mesh, material, x, **options)
    R = oracle.rotation(rng)
    turned_mesh = type(mesh)(mesh.vertices @ R.T, mesh.tets)
    turned = AnisotropicMaterial(material.stiffness, 1000.0, frame=R @ material.frame, damping_ratio=0.0)
    atol = 1e-9 * np.abs(forces).max()
    np.testing.assert_allclose(
        internal_forces(turned_mesh, turned, x @ R.T, **options), forces @ R.T, atol=atol
    )
    np.testing.assert_allclose(internal_forces(mesh, material, x @ R.T, **options), forces @ R.T, atol=atol)
    without = internal_forces(turned_mesh, material, x @ R.T, **options)
    assert np.abs(without - forces @ R.T).max() > 0.05 * np.abs(forces).max()


@pytest.mark.parametrize(
    ("law", "strain", "flips"), [mode for mode in MODES if mode[2] in ("tolerant", None)]
)
def test_a_tolerant_mirror_image_takes_the_mirrored_forces(law, strain, flips):
    rng = np.random.default_rng(8)
    mesh = sphere(0.7, 1)
    material = any_material(mesh, rng)
    x, mirror = oracle.shaken(mesh, rng, 0.05), np.array([1, -1, 1])
    options = {"law": law, "strain": strain, "flips": flips}
    forces = internal_forces(mesh, material, x, **options)
    mirrored = internal_forces(mesh, material, x * mirror, **options)
    np.testing.assert_allclose(mirrored, forces * mirror, atol=1e-9 * np.abs(forces).max())


def pulled(mesh, material, law, axis, stretch):
    """Free sides, two faces held at a distance along `axis`: where the vertices rest, by Newton's method.

    Steps with the gradient of St. Venant-Kirchhoff, which is that of every law at rest.
    """
    x = mesh.vertices.copy()
    low, high = x[:, axis] <= x[:, axis].min() + 1e-9, x[:, axis] >= x[:, axis].max() - 1e-9
    x[:, axis] *= 1 + stretch
    held = np.zeros_like(x, dtype=bool)
    held[low | high, axis] = True
    # Remove rigid motion: one vertex does not move, and another does not rotate around it.
    others = [a for a in range(3) if a != axis]
    first = int(np.flatnonzero(low)[0])
    second = next(v for v in np.flatnonzero(low) if x[v, others[1]] == x[first, others[1]] and v != first)
    held[first] = True
    held[second, others[1]] = True
    free = ~held.ravel()
    for _ in range(8):
        K = -force_gradient(mesh, material, x, law="st_venant_kirchhoff").reshape(x.size, x.size)
        forces = internal_forces(mesh, material, x, law=law)
        move = np.linalg.solve(K[np.ix_(free, free)], forces.ravel()[free])
        flat = x.ravel().copy()
        flat[free] += move
        x = flat.reshape(-1, 3)
    assert np.abs(forces.ravel()[free]).max() < 1e-6 * np.abs(forces).max()
    return x, -forces[high, axis].sum()


@pytest.mark.parametrize("law", ["virial", "st_venant_kirchhoff"])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("turn", [None, (0.0, 0.6, 0.0, 0.8)])
def test_a_pulled_orthotropic_cube_has_the_moduli_it_was_given(law, axis, turn):
    """Young's moduli and Poisson's ratios along each axis; with a turned frame those of that direction."""
    mesh, stretch = box((1, 1, 1), (2, 2, 2)), 1e-4
    x, force = pulled(
        mesh, AnisotropicMaterial(WOOD, 500.0, frame=turn, damping_ratio=0.0), law, axis, stretch
    )
    direction = WOOD.rotated(turn) if turn else WOOD
    expected = direction.young_along(I3[axis])
    assert force / stretch == pytest.approx(expected, rel=0.01)
    if turn is None:
        assert force / stretch == pytest.approx(YOUNG[axis], rel=0.01)
        compliance = np.linalg.inv(WOOD.matrix)
        for across in {0, 1, 2} - {axis}:
            ratio = -compliance[axis, across] / compliance[axis, axis]
            assert np.ptp(x[:, across]) == pytest.approx(1 - ratio * stretch, abs=0.01 * ratio * stretch)


@EACH_MODE
@settings(max_examples=2)
@given(seed=seeds, mirrored=st.booleans())
def test_exact_gradients_equal_differences(law, strain, flips, seed, mirrored):
    """The laws include those whose material rotation depends on the vertices."""
    rng = np.random.default_rng(seed)
    mesh = oracle.MESHES["tet"]
    material = any_material(mesh, rng)
    x = oracle.shaken(mesh, rng, 0.2) * (1, 1, -1 if mirrored else 1)
    options = {"law": law, "strain": strain, "flips": flips}
    exact = force_gradient(mesh, material, x, **options)
    expected, h = np.zeros_like(exact), 1e-4
    for i in np.ndindex(x.shape):
        for step, weight in ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12)):
            moved = x.copy()
            moved[i] += step * h
            expected[(..., *i)] += weight / h * internal_forces(mesh, material, moved, **options)
    np.testing.assert_allclose(exact, expected, atol=2e-6 * np.abs(expected).max())


@EACH_MODE
def test_the_projected_system_is_symmetric_and_never_negative(law, strain, flips):
    """At rest it is the exact gradient, in every pose finite."""
    rng = np.random.default_rng(3)
    mesh = sphere(0.7, 1)
    material = any_material(mesh, rng)
    rest = mesh.vertices
    poses = {
        "at rest": rest,
        "pressed to half": rest * (1, 1, 0.5),
        "scrambled": rng.normal(size=rest.shape),
        "inside out": -rest,
        "flat": rest * (1, 1, 0),
        "a point": rest * 0,
    }
    size = rest.size
    options = {"law": law, "strain": strain, "flips": flips}
    for pose, x in poses.items():
        K = -force_gradient(mesh, material, x, **options, projected=True).reshape(size, size)
        np.testing.assert_allclose(K, K.T, atol=1e-10 * np.abs(K).max(), err_msg=pose)
        values = np.linalg.eigvalsh(K)
        assert values[0] > -1e-9 * values[-1] - 1e-9, pose
    K, exact = (
        -force_gradient(mesh, material, rest, **options, projected=p).reshape(size, size)
        for p in (True, False)
    )
    np.testing.assert_allclose(K, exact, atol=1e-6 * np.abs(K).max())


@pytest.mark.parametrize("stretches", [(1.3, 0.9, 0.7), (1.2, 0.8, 0.03), (1.2, 1.1, -0.8)])
@pytest.mark.parametrize(("law", "strain", "flips"), [mode for mode in MODES if mode[0] == "virial"])
def test_the_projected_system_holds_the_rotation_and_counts_what_pulls(law, strain, flips, stretches):
    """The system is V [M B_i^T C B_j M^T + (g_i . T g_j) I] with F = R U.

    M M^T = R cof(U) R^T, or det(U) I if the strain is linear. T is the positive part of S cof(U)^2 / det(U),
    with det(U) at least 1/20. An inverted tetrahedron that recovers has the modulus of its recovery.
    """
    rng = np.random.default_rng(6)
    mesh = oracle.ONE_TET
    material = any_material(mesh, rng)
    matrix, frame = material.stiffness.matrix, material.frame[0]
    left, right = oracle.rotation(rng), oracle.rotation(rng)
    F = left * stretches @ right
    s = np.abs(stretches)
    R = left * np.sign(stretches) @ right
    of_axes = lambda values: right.T * values @ right  # noqa: E731
    area = s.prod() / s
    M = R @ (of_axes(np.sqrt(area)) if strain == "exact" else np.sqrt(s.prod()) * I3)
    S = stress_in(frame, matrix, of_axes(s - 1 if strain == "exact" else (s**2 - 1) / 2))
    T = S @ of_axes(area**2) / max(s.prod(), 0.05)
    values, axes = np.linalg.eigh((T + T.T) / 2)
    T = (axes * np.maximum(values, 0)) @ axes.T
    if flips == "recover" and stretches[2] < 0:
        M, T = 0 * I3, mean_wave_modulus(matrix) * I3
    inverse = np.linalg.inv((mesh.vertices[1:] - mesh.vertices[0]).T)
    g = np.vstack([-inverse.sum(axis=0), inverse])
    expected = np.zeros((4, 3, 4, 3))
    for i, j in np.ndindex(4, 4):
        by_move = [(np.outer(unit, g[j]) + np.outer(g[j], unit)) / 2 for unit in I3]
        N = [stress_in(frame, matrix, eps) @ g[i] for eps in by_move]
        expected[i, :, j] = M @ np.transpose(N) @ M.T + g[i] @ T @ g[j] * I3
    expected *= -oracle.signed_volume(mesh.vertices)
    options = {"law": law, "strain": strain, "flips": flips}
    found = force_gradient(mesh, material, mesh.vertices @ F.T, **options, projected=True)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("law", ["virial", "st_venant_kirchhoff"])
def test_implicit_euler_holds_a_hanging_bar_of_wood_at_the_length_of_its_modulus(law):
    """Its own weight stretches it by rho g L^2 / (2 E) along the grain."""
    mesh = beam(1.0, 0.2, 0.2, 2)
    x0 = mesh.vertices
    held = np.flatnonzero(x0[:, 0] < x0[:, 0].min() + 1e-6)
    young, density, gravity = YOUNG[0], 500.0, 9.81
    world = bare_world(gravity=(gravity, 0, 0), floor=None, integrator="implicit_euler", tolerance=1e-5)
    body = world.add_body(mesh, AnisotropicMaterial(WOOD, density, 20.0), law=law, pinned=held)
    world.build()
    for _ in range(300):
        world.step(1 / 60, 1)
    tip = x0[:, 0] > x0[:, 0].max() - 1e-6
    stretch = (body.positions()[tip, 0] - x0[tip, 0]).mean()
    assert stretch == pytest.approx(density * gravity / (2 * young), rel=0.05)
    assert np.abs(body.velocities()).max() < 1e-3


def test_moving_in_a_circle_costs_no_work_with_an_energy_and_some_without():
    """Forces summed along a closed path through strained and sheared shapes, by the trapezoid rule."""
    rng = np.random.default_rng(5)
    mesh = oracle.MESHES["tet"]
    material = any_material(mesh, rng)
    a, b = (0.3 * rng.normal(size=(3, 3)) for _ in range(2))
    angles = np.linspace(0, 2 * np.pi, 401)
    path = [mesh.vertices @ (I3 + np.sin(t) * a + (1 - np.cos(t)) * b).T for t in angles]
    for law, most in (("st_venant_kirchhoff", 1e-9), ("virial", None)):
        forces = [internal_forces(mesh, material, x, law=law) for x in path]
        steps = [
            np.sum((f + g) / 2 * (y - x))
            for f, g, x, y in zip(forces, forces[1:], path, path[1:], strict=False)
        ]
        net, gross = abs(sum(steps)), sum(map(abs, steps))
        if most is not None:
            assert net < 1e-4 * gross
        else:
            assert net > 1e-2 * gross


def test_only_the_law_with_an_energy_keeps_that_of_a_ringing_body_without_damping():
    """Over 5 s, eight times stiffer along than across: "virial" gains and loses a tenth and more."""
    mesh = sphere(0.5, 2)
    spreads = {}
    for law in ("st_venant_kirchhoff", "virial"):
        world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
        body = world.add_body(mesh, AnisotropicMaterial(WOOD, 500.0, damping_ratio=0.0), law=law)
        world.build()
        body.set_motion(mesh.vertices * (1.1, 1, 0.9), np.zeros_like(mesh.vertices))
        energies = []
        for _ in range(600):
            world.step(1 / 120, 40)
            energies.append(body.elastic_energy() + body.kinetic_energy())
        spreads[law] = np.ptp(energies) / np.mean(energies)
        assert not body.is_frozen
    assert spreads["st_venant_kirchhoff"] < 0.003
    assert spreads["virial"] > 0.1


@pytest.mark.parametrize(("law", "is_lost"), [("virial", True), ("st_venant_kirchhoff", False)])
@pytest.mark.filterwarnings("ignore::taichi_soft.FrozenBodyWarning")
def test_stretched_by_a_third_and_undamped_only_the_law_with_an_energy_holds(law, is_lost):
    """The README says so among the limits; the lost body is put back and frozen."""
    mesh = sphere(0.5, 2)
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(mesh, AnisotropicMaterial(WOOD, 500.0, damping_ratio=0.0), law=law)
    world.build()
    body.set_motion(mesh.vertices * (1.3, 1, 0.7), np.zeros_like(mesh.vertices))
    for _ in range(300):
        world.step(1 / 120, 40)
    assert body.is_frozen == is_lost
    assert np.isfinite(body.positions()).all()


def test_elastic_energy_and_stress_are_those_of_the_material():
    mesh = box((1, 1, 1), (2, 2, 2))
    stretch = np.diag([1.02, 0.99, 1.01])
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(
        mesh, AnisotropicMaterial(WOOD, 500.0, damping_ratio=0.0), law="st_venant_kirchhoff"
    )
    world.build()
    body.set_motion(mesh.vertices @ stretch, np.zeros_like(mesh.vertices))
    E = (stretch @ stretch - I3) / 2
    stress = stress_in(I3, WOOD.matrix, E)
    assert body.elastic_energy() == pytest.approx(np.sum(E * stress) / 2, rel=1e-4)
    cauchy = stretch @ stress @ stretch / np.linalg.det(stretch)
    deviator = cauchy - np.trace(cauchy) / 3 * I3
    np.testing.assert_allclose(body.vertex_stress(), np.sqrt(1.5 * np.sum(deviator**2)), rtol=1e-4)


@pytest.mark.parametrize("strain", ["linear", "exact"])
def test_a_scrambled_anisotropic_body_finds_its_shape_again(strain):
    """The stiffest direction is eight times as stiff as the softest."""
    mesh, rng = sphere(1.0, 2), np.random.default_rng(4)
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(
        mesh, AnisotropicMaterial(WOOD, 1000, 200, damping_ratio=0.0), strain=strain, flips="recover"
    )
    world.build()
    body.set_motion(rng.uniform(-1, 1, mesh.vertices.shape), np.zeros_like(mesh.vertices))
    for _ in range(900):
        world.step(1 / 60, 16)
    assert not body.is_frozen
    assert body.flipped_count() == 0
    ends = body.positions().astype(float)[mesh.edges]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), mesh.edge_lengths, rtol=0.02)


def test_the_stable_step_is_that_of_the_stiffest_direction():
    """The reference is the dense eigenvalues of M^-1 K, with the gradient K at rest."""
    mesh = sphere(0.5, 1)
    material = any_material(mesh, np.random.default_rng(2))
    K = -force_gradient(mesh, material, mesh.vertices, law="st_venant_kirchhoff").reshape(
        mesh.vertices.size, -1
    )
    mass = np.zeros(len(mesh.vertices))
    for tet in mesh.tets:
        mass[tet] += 1000.0 * oracle.signed_volume(mesh.vertices[tet]) / 4
    root = np.sqrt(np.repeat(mass, 3))
    expected = 2 / np.sqrt(np.linalg.eigvalsh(K / np.outer(root, root))[-1])
    found = stable_step(mesh, material, element_model("virial")).limit
    assert expected * 0.85 < found <= expected


@pytest.mark.parametrize("law", ["st_venant_kirchhoff", "virial"])
def test_a_beam_of_oblique_fibres_twists_aside_as_it_is_pulled_down(law):
    """One that is the same in all directions does not; implicit Euler finds the same shape as leapfrog."""
    mesh = beam(2.0, 0.2, 0.2, 1)
    reed = Stiffness.one_axis(2e7, 1e6, 0.3, 0.3, 4e5)
    slant = (0.0, 0.0, np.sin(np.pi / 12), np.cos(np.pi / 12))  # fibres 30 degrees from the beam, towards y
    held = np.flatnonzero(mesh.vertices[:, 0] < mesh.vertices[:, 0].min() + 1e-6)
    tip = mesh.vertices[:, 0] > mesh.vertices[:, 0].max() - 1e-6
    shapes = {}
    for name, frame, integrator, substeps in (
        ("straight", None, "leapfrog", None),
        ("slanted", slant, "leapfrog", None),
        ("implicit", slant, "implicit_euler", 1),
    ):
        world = bare_world(gravity=(2.0, 0, 0), floor=None, integrator=integrator, tolerance=1e-5, retries=0)
        material = AnisotropicMaterial(reed, 500.0, 40.0, frame, damping_ratio=0.0)
        body = world.add_body(mesh, material, law=law, pinned=held)
        world.build()
        for _ in range(400):
            world.step(1 / 60, substeps)
        shapes[name] = body.positions().astype(float)
    aside = {name: (x - mesh.vertices)[tip, 1].mean() for name, x in shapes.items()}
    assert abs(aside["straight"]) < 1e-6
    assert abs(aside["slanted"]) > 1e-5
    np.testing.assert_allclose(shapes["implicit"], shapes["slanted"], atol=2e-3)


@pytest.mark.guard
def test_both_schedules_and_plain_bodies_beside_move_the_same():
    """The tolerance is float32 round-off, because the schedules sum forces in different orders."""
    mesh = sphere(0.3, 1)
    ends = []
    for schedule in ("per_body", "flat"):
        world = bare_world(gravity=(0, 0, -9.81), schedule=schedule, retries=0)
        wood = world.add_body(
            mesh, AnisotropicMaterial(WOOD, 500.0, 5.0, damping_ratio=0.0), position=(0, 0, 0.5)
        )
        world.add_body(mesh, Material(3e5, 0.2, 500.0, 5.0, damping_ratio=0.0), position=(1, 0, 0.5))
        world.build()
        for _ in range(40):
            world.step(1 / 60, 16)
        ends.append(wood.positions())
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-4)
