"""Shells: forces are the negative gradient of an independent energy, and conserve momentum."""

import numpy as np
import pytest

from taichi_soft import (
    MaterialError,
    MeshError,
    OptionError,
    ShellMaterial,
    ShellMesh,
    box,
    force_gradient,
    internal_forces,
    sheet,
)
from taichi_soft.elements.laws.shell import shells_of

YOUNG, POISSON, THICKNESS = 2e4, 0.3, 0.02
MATERIAL = ShellMaterial(YOUNG, POISSON, density=300, thickness=THICKNESS)


def curved(seed=3):
    """A bent and twisted sheet with uneven triangles, as its shape at rest."""
    flat = sheet((1.0, 0.8), (4, 3))
    x = flat.vertices + np.random.default_rng(seed).uniform(-0.04, 0.04, flat.vertices.shape)
    x[:, 2] += 0.4 * x[:, 0] ** 2 + 0.3 * x[:, 0] * x[:, 1]
    return ShellMesh(x, flat.triangles)


def hinges_of(triangles):
    """Return the two triangles and the opposite corners of every inner edge, with its ends."""
    owners = {}
    for t, corners in enumerate(triangles.tolist()):
        for k in range(3):
            ends = corners[(k + 1) % 3], corners[(k + 2) % 3]
            owners.setdefault(tuple(sorted(ends)), []).append((t, corners[k]))
    return owners


def outward(x, p, q, apex):
    """Return the outward normal of the edge p q of a triangle in its plane, times the length of the edge."""
    e, r = x[q] - x[p], x[apex] - x[p]
    away = r @ e / (e @ e) * e - r
    return np.linalg.norm(e) * away / np.linalg.norm(away)


def energy_of(mesh, x, young=YOUNG, nu=POISSON, t=THICKNESS):
    """Return the energy of a shell: Green's strain in plane stress, and a plate with the curvature of hinges.

    The vector of a hinge is a linear function of the positions, with the cotangents of the rest shape.
    """
    total, hinges = 0.0, hinges_of(mesh.triangles)
    area = [
        np.linalg.norm(np.cross(*(mesh.vertices[c[1:]] - mesh.vertices[c[0]]))) / 2 for c in mesh.triangles
    ]
    for number, corners in enumerate(mesh.triangles):
        rest, now = mesh.vertices[corners], x[corners]
        first = (rest[1] - rest[0]) / np.linalg.norm(rest[1] - rest[0])
        normal = np.cross(rest[1] - rest[0], rest[2] - rest[0])
        axes = np.stack([first, np.cross(normal / np.linalg.norm(normal), first)])
        shape = axes @ (rest[1:] - rest[0]).T
        F = (now[1:] - now[0]).T @ np.linalg.inv(shape)
        green = (F.T @ F - np.eye(2)) / 2
        modulus = young / (1 - nu**2)
        total += area[number] * t * modulus / 2 * ((1 - nu) * (green**2).sum() + nu * np.trace(green) ** 2)

        frame = np.stack(
            [now[1] - now[0], now[2] - now[0], np.cross(now[1] - now[0], now[2] - now[0])], axis=1
        )
        rest_frame = np.stack([rest[1] - rest[0], rest[2] - rest[0], normal], axis=1)
        curvature, free = np.zeros((3, 2, 2)), []
        for k in range(3):
            p, q = corners[(k + 1) % 3], corners[(k + 2) % 3]
            m = axes @ outward(mesh.vertices, p, q, corners[k])
            m /= np.linalg.norm(m)
            others = [pair for pair in hinges[tuple(sorted((p, q)))] if pair[0] != number]
            if not others:
                free.append(np.outer(m, m))
                continue
            other, apex = others[0]
            change = hinge(mesh.vertices, x, p, q, corners[k], apex) - frame @ np.linalg.solve(
                rest_frame, hinge(mesh.vertices, mesh.vertices, p, q, corners[k], apex)
            )
            curvature += change[:, None, None] * np.outer(m, m) / (area[number] + area[other])
        plate = young * t**3 / (12 * (1 - nu**2)) * area[number]
        # The smallest energy for any curvature across the free edges.
        basis = [np.eye(3)[i][:, None, None] * each for each in free for i in range(3)]
        if basis:
            gram = np.array([[bilinear(plate, nu, a, b) for b in basis] for a in basis])
            amounts = np.linalg.solve(gram, [bilinear(plate, nu, a, curvature) for a in basis])
            curvature = curvature - sum(amount * each for amount, each in zip(amounts, basis, strict=True))
        total += bilinear(plate, nu, curvature, curvature) / 2
    return total


def bilinear(plate, nu, a, b):
    """Return the work of the moments of curvature a in curvature b; both have a component for each axis."""
    traces = np.trace(a, axis1=1, axis2=2) @ np.trace(b, axis1=1, axis2=2)
    return plate * ((1 - nu) * (a * b).sum() + nu * traces)


def hinge(rest, x, p, q, apex, other):
    """Return the sum of the edge's two outward normals at rest, as a linear function of the positions x."""
    found = np.zeros(3)
    for each in (apex, other):

        def cot(at, a, b):
            u, v = rest[a] - rest[at], rest[b] - rest[at]
            return u @ v / np.linalg.norm(np.cross(u, v))

        at_p, at_q = cot(p, q, each), cot(q, p, each)
        found += at_q * x[p] + at_p * x[q] - (at_p + at_q) * x[each]
    return found


def gradient_of(mesh, x, **constants):
    h, found = 1e-6, np.zeros_like(x)
    for row in range(len(x)):
        for axis in range(3):
            ahead, behind = x.copy(), x.copy()
            ahead[row, axis] += h
            behind[row, axis] -= h
            found[row, axis] = (
                energy_of(mesh, ahead, **constants) - energy_of(mesh, behind, **constants)
            ) / (2 * h)
    return found


def rotation(angle, axis):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def moved(mesh, seed, size):
    return mesh.vertices @ rotation(1.1, (1, 2, -1)).T + np.random.default_rng(seed).normal(
        0, size, mesh.vertices.shape
    )


@pytest.mark.parametrize("mesh", [sheet((1.0, 0.7), (3, 2)), curved()], ids=["flat", "curved"])
def test_forces_are_the_negative_gradient_of_the_energy(mesh):
    x = moved(mesh, 0, 0.03)
    expected = -gradient_of(mesh, x)
    got = internal_forces(mesh, MATERIAL, x, law="shell")
    assert np.abs(got - expected).max() < 1e-6 * np.abs(expected).max()


def test_the_linear_vector_of_a_hinge_is_the_sum_of_outward_normals():
    mesh = curved()
    for (p, q), pairs in hinges_of(mesh.triangles).items():
        if len(pairs) == 2:
            apex, other = pairs[0][1], pairs[1][1]
            expected = outward(mesh.vertices, p, q, apex) + outward(mesh.vertices, p, q, other)
            assert np.allclose(hinge(mesh.vertices, mesh.vertices, p, q, apex, other), expected, atol=1e-12)


@pytest.mark.parametrize("mesh", [sheet((1.0, 0.7), (3, 2)), curved()], ids=["flat", "curved"])
def test_a_rigid_motion_of_the_rest_shape_gives_no_force(mesh):
    x = mesh.vertices @ rotation(2.0, (3, -1, 2)).T + (5.0, -3.0, 2.0)
    v = np.cross((1.0, -2.0, 0.5), x) + np.array([3.0, 1.0, 0.0])
    damped = ShellMaterial(YOUNG, POISSON, 300, THICKNESS, damping=3.0, bending_damping=0.1)
    scale = np.abs(internal_forces(mesh, MATERIAL, moved(mesh, 0, 0.03), law="shell")).max()
    assert np.abs(internal_forces(mesh, damped, x, v, law="shell")).max() < 1e-12 * scale


@pytest.mark.parametrize("mesh", [sheet((1.0, 0.7), (3, 2)), curved()], ids=["flat", "curved"])
def test_forces_of_elasticity_and_damping_sum_to_zero_and_have_no_moment(mesh):
    x, v = moved(mesh, 1, 0.1), np.random.default_rng(2).normal(0, 2.0, mesh.vertices.shape)
    damped = ShellMaterial(YOUNG, POISSON, 300, THICKNESS, damping=3.0, bending_damping=0.1)
    forces = internal_forces(mesh, damped, x, v, law="shell")
    assert np.abs(forces - internal_forces(mesh, MATERIAL, x, law="shell")).max() > 1.0
    assert np.abs(forces.sum(axis=0)).max() < 1e-12 * np.abs(forces).max()
    assert np.abs(np.cross(x, forces).sum(axis=0)).max() < 1e-12 * np.abs(forces).max()


def test_damping_of_bending_takes_energy_in_any_motion():
    mesh, rng = curved(), np.random.default_rng(5)
    damped = ShellMaterial(YOUNG, POISSON, 300, THICKNESS, bending_damping=0.1)
    for _ in range(20):
        x, v = moved(mesh, int(rng.integers(1000)), 0.1), rng.normal(0, 2.0, mesh.vertices.shape)
        work = (
            v
            * (
                internal_forces(mesh, damped, x, v, law="shell")
                - internal_forces(mesh, damped, x, law="shell")
            )
        ).sum()
        assert work < 0.0


def test_a_triangle_crushed_to_a_line_or_a_point_has_finite_forces():
    mesh = curved()
    for squeezed in (mesh.vertices * (1, 0, 0), mesh.vertices * 0.0, mesh.vertices * (-1, 1, 1)):
        assert np.isfinite(internal_forces(mesh, MATERIAL, squeezed, law="shell", dtype=np.float32)).all()
    turned = mesh.vertices * (-1, -1, 1)  # turned about z: at rest
    assert np.abs(internal_forces(mesh, MATERIAL, turned, law="shell")).max() < 1e-9


def test_a_uniformly_stretched_sheet_pulls_as_plane_stress_says():
    mesh, strain = sheet((1.0, 0.5), (6, 3)), 1e-4
    x = mesh.vertices * (1 + strain, 1 - POISSON * strain, 1)  # uniaxial stress
    forces = internal_forces(mesh, MATERIAL, x, law="shell")
    right = mesh.vertices[:, 0] > 0.49
    assert forces[right, 0].sum() == pytest.approx(-YOUNG * THICKNESS * 0.5 * strain, rel=1e-3)
    assert np.abs(forces[~right & (mesh.vertices[:, 0] > -0.49)]).max() < 1e-3 * np.abs(forces).max()


@pytest.mark.parametrize("across", [0.0, 1.0, -1.0], ids=["cylinder", "sphere", "saddle"])
def test_a_bent_plate_has_the_energy_of_plate_theory(across):
    """Energy per area: 1/2 D (k1^2 + k2^2 + 2 nu k1 k2). It is exact in inner triangles of a regular mesh."""
    mesh, k = sheet((1.0, 1.0), (20, 20)), 1e-3
    u = mesh.vertices @ rotation(0.5, (0, 0, 1)).T
    x = mesh.vertices + np.stack(
        [0 * k * u[:, 0], 0 * u[:, 0], k / 2 * (u[:, 0] ** 2 + across * u[:, 1] ** 2)], axis=1
    )
    inner = (np.abs(mesh.vertices[mesh.triangles]) < 0.46).all(axis=(1, 2))
    plate = YOUNG * THICKNESS**3 / (12 * (1 - POISSON**2))
    expected = plate / 2 * k**2 * (1 + across**2 + 2 * POISSON * across) * mesh.areas[inner].sum()

    shells = shells_of(mesh, MATERIAL)
    d = x[shells.points][:, 1:] - x[shells.points][:, :1]
    q = shells.bending[:, :15].reshape(-1, 3, 5) @ d
    assert (q[inner] ** 2).sum() / 2 == pytest.approx(expected, rel=1e-3)


@pytest.mark.numpy
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"young": 0}, "young is 0: it must be above 0 Pa"),
        ({"poisson": 0.6}, "poisson is 0.6: it must be above -1 and at most 0.5"),
        ({"density": -1}, "density is -1"),
        ({"thickness": 0}, "thickness is 0: it must be above 0 m"),
        ({"damping": -1}, "damping is -1"),
        ({"bending_damping": np.inf}, "bending_damping is inf"),
        ({"young": [1.0, 2.0], "density": [1.0, 2.0, 3.0]}, "arrays of different lengths"),
    ],
)
def test_constants_out_of_range_are_refused(change, message):
    constants = {"young": 1e6, "poisson": 0.3, "density": 300, "thickness": 1e-3} | change
    with pytest.raises(MaterialError, match=message):
        ShellMaterial(**constants)


def test_a_shell_is_refused_where_it_has_no_meaning():
    mesh = sheet((1, 1), (2, 2))
    with pytest.raises(MaterialError, match="leave out law"):
        internal_forces(mesh, MATERIAL, mesh.vertices, law="virial")
    with pytest.raises(OptionError, match="force_gradient does not support a ShellMesh"):
        force_gradient(mesh, MATERIAL, mesh.vertices, law="shell")
    with pytest.raises(MaterialError, match="3 values for a mesh of 8 triangles"):
        internal_forces(mesh, ShellMaterial([1.0, 2.0, 3.0], 0, 1, 1), mesh.vertices, law="shell")
    with pytest.raises(MeshError, match="needs a ShellMesh"):
        internal_forces(box((1, 1, 1), (1, 1, 1)), MATERIAL, np.zeros((8, 3)), law="shell")
