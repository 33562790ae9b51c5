"""Shells: a membrane that resists stretching, and a plate that resists bending.

The membrane is St. Venant-Kirchhoff's law in plane stress, on triangles with constant strain. A triangle in
space has no inside and outside, so it cannot be inverted: its mirror image is the same triangle seen from
behind. The energy is a polynomial of the positions. Forces are therefore finite in every shape, and a
triangle that is crushed to a line or a point leaves this shape again. A law with a logarithm of the area
would need endless substeps there.

The plate has a constant curvature in each triangle, from the triangle and its three neighbours, as in the
basic shell triangle of Onate and Zarate (2000). The hinge at edge k of length l_k has the vector
v_k = l_k (t + t'). Here t and t' are the outward normals of the edge in the planes of both triangles. The
length of v_k is 2 l_k sin(angle / 2). If edges keep their lengths, v_k is a linear function of the positions,
with cotangents as weights (Bergou, Wardetzky, Harmon, Zorin and Grinspun 2006). The curvature of a triangle
is

    kappa = sum over k of v_k m_k m_k^T / (A + A_k),

where m_k is the normal of the edge in the plane at rest, and A and A_k are the areas of the triangle and its
neighbour. The energy is that of a plate with stiffness E t^3 / (12 (1 - nu^2)) and Poisson's ratio nu. The
bending moment across a free edge is zero, so the energy is the smallest one for any curvature across that
edge. Let L L^T be the stiffness for (kappa_xx, kappa_yy, kappa_xy), and q = L^T kappa. The energy is then
1/2 (|q_0|^2 + |q_1|^2 + |q_2|^2), with

    q_r = sum over j of W_rj (x_j - x_0) - c_r n,    n = (x_1 - x_0) x (x_2 - x_0).

The six points are the corners x_0, x_1, x_2 and the neighbours' opposite corners. For a shell that is curved
at rest, c and two of the weights subtract the value at rest, which rotates with the triangle. So the rest
shape has no energy and no force, and neither have its rigid motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.residue import SHARE, without_residue
from taichi_soft.core.runtime import ti
from taichi_soft.elements.materials.shell_material import ShellMaterial
from taichi_soft.meshing.shell_mesh import ShellMesh, half_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

POINTS, WEIGHTS = 6, 15
"""Number of points of a shell element, and number of its weights: three for each point except the first."""


@dataclass(frozen=True, eq=False)
class Shells:
    """Constants of every triangle of a shell, in the order of `ShellMesh.triangles`.

    Attributes:
        points: (m, 6) corners, and opposite corners of the neighbours at the edges 12, 20 and 01. Without a
            neighbour, the point is the first corner, and its weights are zero.
        rest_inverse: (m, 3) entries 00, 01 and 11 of the inverse of the rest shape [1/m]. The rest shape has
            the vectors from the first corner to the other corners as columns. Its x axis lies along the first
            vector.
        lame: (m, 2) lambda and mu of plane stress, times the volume at rest [J].
        bending: (m, 18) weights W_rj [J^1/2 / m], five for each r, then c_r [J^1/2 / m^2].
        bending_damping: (m,) [s].
    """

    points: Ints
    rest_inverse: Floats
    lame: Floats
    bending: Floats
    bending_damping: Floats


@ti.func
def _moment(d, along, turning, n, unit, weights, c, bending_damping):
    """Return the derivatives of one term of the bending energy with respect to q and to n, with damping.

    Args:
        d: positions of the points 1 to 5 relative to point 0, five vec3 [m].
        along: velocities of these points relative to point 0, along `unit`, five numbers [m/s].
        turning: derivative of `unit` [1/s].
        n, unit: cross product of the first two of `d` [m^2], and the same divided by its length at rest.
        weights, c: W_rj, five numbers, and c_r, see the module.
        bending_damping: [s].
    """
    q, rate = n * -c, along[0] * 0.0
    for j in ti.static(range(5)):
        q += d[j] * weights[j]
        rate += along[j] * weights[j]
    # Rate of the part of q along `unit`. A rigid motion has none.
    rate = bending_damping * (rate + q.dot(turning) - c * n.dot(turning))
    moment = q + unit * rate
    return moment, q * rate, moment * c


@ti.func
def shell_forces(d, w, rest_inverse, lame, bending, bending_damping):
    """Forces on the points 1 to 5 of a shell element [N]. The force on point 0 is the opposite of their sum.

    Args:
        d, w: positions [m] and velocities [m/s] of the points 1 to 5 relative to point 0, five vec3 each.
        rest_inverse, lame, bending, bending_damping: see `Shells`; lists of numbers, and a number.
    """
    a, b = d[0], d[1]
    f1, f2 = a * rest_inverse[0], a * rest_inverse[1] + b * rest_inverse[2]
    e11, e22, e12 = 0.5 * (f1.dot(f1) - 1.0), 0.5 * (f2.dot(f2) - 1.0), 0.5 * f1.dot(f2)
    pressure, twice_mu = lame[0] * (e11 + e22), 2.0 * lame[1]
    s11, s22, s12 = pressure + twice_mu * e11, pressure + twice_mu * e22, twice_mu * e12
    p1, p2 = f1 * s11 + f2 * s12, f1 * s12 + f2 * s22

    n = a.cross(b)
    inverse_area = rest_inverse[0] * rest_inverse[2]  # 1 / |n| at rest
    unit = n * inverse_area
    turning = (w[0].cross(b) + a.cross(w[1])) * inverse_area
    along = [w[j].dot(unit) for j in ti.static(range(5))]
    m0, u0, c0 = _moment(d, along, turning, n, unit, bending[0:5], bending[15], bending_damping)
    m1, u1, c1 = _moment(d, along, turning, n, unit, bending[5:10], bending[16], bending_damping)
    m2, u2, c2 = _moment(d, along, turning, n, unit, bending[10:15], bending[17], bending_damping)
    across = (u0 + u1 + u2) * inverse_area - (c0 + c1 + c2)  # derivative of the energy with respect to n
    g = [m0 * bending[j] + m1 * bending[5 + j] + m2 * bending[10 + j] for j in ti.static(range(5))]
    g1 = g[0] + p1 * rest_inverse[0] + p2 * rest_inverse[1] + b.cross(across)
    g2 = g[1] + p2 * rest_inverse[2] + across.cross(a)
    return -g1, -g2, -g[2], -g[3], -g[4]


def shells_of(mesh: ShellMesh, material: ShellMaterial) -> Shells:
    """Return the constants of the triangles of a shell."""
    m = len(mesh.triangles)
    young, nu, thickness, bending_damping = (
        material.per_triangle(name, m) for name in ("young", "poisson", "thickness", "bending_damping")
    )
    mu, plane = young / (2.0 * (1.0 + nu)), young / (1.0 - nu * nu)
    volume = mesh.areas * thickness
    lame = np.stack([nu * plane * volume, mu * volume], axis=1)
    points, weights = _curvature_weights(mesh)
    stiffness = (plane * (thickness * thickness * thickness) / 12.0 * mesh.areas)[:, None, None] * _plate(nu)
    root = _root_without_free_edges(stiffness, mesh, points)
    rows = _times(root.swapaxes(1, 2), weights)  # (m, 3, 6)
    return Shells(points, _rest_inverses(mesh), lame, _without_rest(mesh, points, rows), bending_damping)


def _dot(a: Floats, b: Floats) -> Floats:
    """Return scalar products along the last axis, summed in a fixed order."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def _times(matrices: Floats, rows: Floats) -> Floats:
    """Return the products of matrices, (m, 3, 3), and matrices, (m, 3, k), summed in a fixed order."""
    return np.asarray(sum(matrices[:, :, i, None] * rows[:, None, i] for i in range(3)))


def _rest_inverses(mesh: ShellMesh) -> Floats:
    x0, x1, x2 = mesh.vertices[mesh.triangles].swapaxes(0, 1)
    a, b = x1 - x0, x2 - x0
    length = np.sqrt(_dot(a, a))
    height = 2.0 * mesh.areas / length
    return np.stack([1.0 / length, -_dot(a, b) / (length * length * height), 1.0 / height], axis=1)


def _plate(nu: Floats) -> Floats:
    """Return the stiffness of a plate for (kappa_xx, kappa_yy, kappa_xy), if E t^3 / (12 (1 - nu^2)) is 1."""
    plate = np.zeros((len(nu), 3, 3))
    plate[:, 0, 0] = plate[:, 1, 1] = 1.0
    plate[:, 0, 1] = plate[:, 1, 0] = nu
    plate[:, 2, 2] = 2.0 * (1.0 - nu)
    return plate


def _edge_planes(mesh: ShellMesh) -> Floats:
    """Return m m^T of the normal m of each edge in the plane of its triangle, (m, 3, 3): xx, yy, xy."""
    x0, x1, x2 = mesh.vertices[mesh.triangles].swapaxes(0, 1)
    a, b = x1 - x0, x2 - x0
    length = np.sqrt(_dot(a, a))
    zero = 0.0 * length
    corners = [(zero, zero), (length, zero), (_dot(a, b) / length, 2.0 * mesh.areas / length)]
    found = []
    for k in range(3):
        (px, py), (qx, qy) = corners[(k + 1) % 3], corners[(k + 2) % 3]
        x, y = qx - px, qy - py
        square = x * x + y * y
        found.append(np.stack([y * y / square, x * x / square, -x * y / square], axis=1))
    return np.stack(found, axis=1)


def _neighbours(mesh: ShellMesh) -> Ints:
    """Return the neighbour's half edge at each half edge, (3 m,); -1 at a free edge. See `half_edges`."""
    pairs = half_edges(mesh.triangles)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    is_pair = (pairs[order][1:] == pairs[order][:-1]).all(axis=1)
    first, second = order[:-1][is_pair], order[1:][is_pair]
    other = np.full(len(pairs), -1, dtype=np.int32)
    other[first], other[second] = second, first
    return other


def _curvature_weights(mesh: ShellMesh) -> tuple[Ints, Floats]:
    """Return the points of each element, (m, 6), and weights of kappa_xx, _yy and _xy, (m, 3, 6) [1/m^2]."""
    triangles, other = mesh.triangles, _neighbours(mesh)
    has_other = other >= 0
    owner, corner = np.divmod(np.maximum(other, 0), 3)
    opposite = np.where(has_other, triangles[owner, corner], np.repeat(triangles[:, 0], 3))
    points = np.concatenate([triangles, opposite.reshape(-1, 3)], axis=1).astype(np.int32)

    x = mesh.vertices[triangles]
    cotangents = np.empty(triangles.shape)  # of the angle at each corner
    for k in range(3):
        p, q = x[:, (k + 1) % 3] - x[:, k], x[:, (k + 2) % 3] - x[:, k]
        cotangents[:, k] = _dot(p, q) / (2.0 * mesh.areas)
    areas = mesh.areas + np.where(has_other, mesh.areas[owner], 0.0).reshape(-1, 3).T  # (3, m)

    weights, planes = np.zeros((len(triangles), 3, 6)), _edge_planes(mesh)
    rows = np.arange(len(triangles))
    for k in range(3):
        j, i = (k + 1) % 3, (k + 2) % 3
        half = 3 * rows + k
        # Cotangents of the neighbour at the same two vertices, whose order can differ.
        other_j, other_i = (corner[half] + 1) % 3, (corner[half] + 2) % 3
        turned = triangles[owner[half], other_j] != triangles[:, j]
        beyond_j = cotangents[owner[half], np.where(turned, other_i, other_j)]
        beyond_i = cotangents[owner[half], np.where(turned, other_j, other_i)]
        vector = np.zeros((len(triangles), 6))  # weights of v_k
        own_j, own_i = cotangents[:, j], cotangents[:, i]
        vector[:, j], vector[:, i], vector[:, k] = own_i + beyond_i, own_j + beyond_j, -(own_j + own_i)
        vector[:, 3 + k] = -(beyond_j + beyond_i)
        vector *= (has_other[half] / areas[k])[:, None]
        weights += planes[:, k, :, None] * vector[:, None, :]
    return points, weights


def _root_without_free_edges(stiffness: Floats, mesh: ShellMesh, points: Ints) -> Floats:
    """Return L with L L^T = stiffness, (m, 3, 3), after the moment across free edges is made zero."""
    planes, is_free = _edge_planes(mesh), (_neighbours(mesh) < 0).reshape(-1, 3)
    scale = stiffness[:, 0, 0]
    for k in range(3):
        moment = _times(stiffness, planes[:, k, :, None])[:, :, 0]
        energy = _dot(planes[:, k], moment)
        is_stiff = is_free[:, k] & (energy > 1e-9 * scale)
        share = np.where(is_stiff, 1.0 / np.where(is_stiff, energy, 1.0), 0.0)
        stiffness = stiffness - share[:, None, None] * moment[:, :, None] * moment[:, None, :]
    root = np.zeros_like(stiffness)
    for k in range(3):  # Cholesky's method; directions without stiffness get zeros
        pivot = stiffness[:, k, k]
        is_stiff = pivot > 1e-9 * scale
        column = stiffness[:, :, k] / np.sqrt(np.where(is_stiff, pivot, 1.0))[:, None]
        root[:, :, k] = np.where(is_stiff[:, None], column, 0.0)
        stiffness = stiffness - root[:, :, k, None] * root[:, None, :, k]
    return np.asarray(np.tril(root))


def _without_rest(mesh: ShellMesh, points: Ints, rows: Floats) -> Floats:
    """Return `Shells.bending`: the weights of five points and c, such that q is zero at rest.

    Args: rows: weights of all six points without the value at rest, (m, 3, 6).
    """
    x = mesh.vertices[points]
    d = x[:, 1:] - x[:, :1]
    weights = without_residue(rows[:, :, 1:].copy(), axis=(1, 2))
    rest = sum(weights[:, :, j, None] * d[:, None, j] for j in range(5))
    largest = sum(np.abs(weights[:, :, j, None] * d[:, None, j]) for j in range(5)).max(axis=(1, 2))
    rest = np.where(np.abs(rest) > SHARE * largest[:, None, None], rest, 0.0)
    a, b = d[:, :1], d[:, 1:2]
    n = np.cross(a, b)
    aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
    determinant = aa * bb - ab * ab
    along_a, along_b = _dot(rest, a), _dot(rest, b)
    weights[:, :, 0] -= (along_a * bb - along_b * ab) / determinant
    weights[:, :, 1] -= (along_b * aa - along_a * ab) / determinant
    normal = _dot(rest, n) / _dot(n, n)
    return np.concatenate([weights.reshape(-1, WEIGHTS), normal], axis=1)
