"""Derivatives of an anisotropic tetrahedron's forces with respect to its vertices, for implicit integration.

The law of St. Venant-Kirchhoff involves no rotation. The laws of thesis chapter 6 involve the rotation R of
F = R U. With S = C : eps(U), Q = S cof(U) and P = R Q, the force on a vertex is -V P g. g is the gradient of
the barycentric coordinate of the vertex. A change dF changes both U and R. With U = A diag(s) A^T and
G = A^T R^T dF A,

    dU = A [(s_a G_ab + s_b G_ba) / (s_a + s_b)] A^T,    R^T dR = A [(G_ab - G_ba) / (s_a + s_b)] A^T.

These forces have no energy, so their derivative is not symmetric. Conjugate gradients therefore use another
matrix, which is positive semi-definite by construction: the stiffness C, rotated by a fixed R and weighted by
the deformed areas (Mueller and Gross 2004, Interactive virtual materials), plus the contribution of tension.
"""

from taichi_soft.core.math.eigen import from_axes, symmetric_eigen
from taichi_soft.core.math.polar import orthogonal_factor
from taichi_soft.core.math.tensors import (
    cofactor,
    determinant,
    outer,
    plus,
    product,
    scaled_plus_identity,
    symmetric_part,
    times,
    transposed,
)
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Flips, Strain
from taichi_soft.elements.laws.anisotropy import anisotropic_stress, between, green_stress, wave_modulus
from taichi_soft.elements.laws.force_gradients import element_stiffness, positive_part, stiffness_block

MIN_VOLUME = 0.05
"""Lower limit of the relative volume V / V0 as a divisor of the tension. It keeps the stiffness of a flat
tetrahedron finite."""


@ti.func
def _stress_in_rest_axes(model: ti.template(), F, U, stiffness):
    """Stress S = C : eps in the axes of the rest shape [Pa], as columns, for the model's strain eps."""
    if ti.static(model.strain == Strain.EXACT):
        return anisotropic_stress(scaled_plus_identity(U, 1.0, -1.0), stiffness)
    else:
        return green_stress(F, stiffness)


@ti.func
def fixed_rotation_stiffness(model: ti.template(), F, stiffness):
    """Return the arguments F and `stress` of `pair_stiffness`, as columns, for a law of thesis chapter 6.

    With these arguments, the stiffness is positive semi-definite. For an inverted tetrahedron with
    `flips="recover"`, these arguments contain only the modulus of `recovering_piola`.
    """
    R = orthogonal_factor(F)
    U = symmetric_part(product(transposed(R), F))
    others = cofactor(U)
    values, A = symmetric_eigen(others)
    weight = ti.sqrt(ti.max(values, 0.0))
    if ti.static(model.strain != Strain.EXACT):  # d eps = sym(U dU), and U cof(U) = det(U) I
        weight = weight * 0.0 + ti.sqrt(ti.max(determinant(U), 0.0))
    W = from_axes(weight, A)
    S = _stress_in_rest_axes(model, F, U, stiffness)
    tension = positive_part(product(S, product(others, others)))
    a, b, c = plus(tension, 1.0 / ti.max(determinant(U), MIN_VOLUME), tension, 0.0)
    d, e, f = product(R, W)
    if ti.static(model.flips == Flips.RECOVER):
        if determinant(F) < 0.0:
            a, b, c = scaled_plus_identity(tension, 0.0, wave_modulus(stiffness))
            d, e, f = F[0] * 0.0, F[1] * 0.0, F[2] * 0.0
    return (d, e, f), (a, b, c)


@ti.func
def rotating_pair_stiffness(model: ti.template(), F, gi, gj, stiffness):
    """Exact negative derivative of the force on vertex i with respect to the position of vertex j.

    The model must have a law of thesis chapter 6.

    Args:
        gi, gj: see `pair_stiffness`.
    Returns: columns [N/m].
    """
    R = orthogonal_factor(F)
    U = symmetric_part(product(transposed(R), F))
    s, A = symmetric_eigen(U)
    S = _stress_in_rest_axes(model, F, U, stiffness)
    Q = product(S, cofactor(U))
    RA = product(R, A)
    side = F[0].x * 0.0 + 1.0
    if ti.static(model.flips == Flips.OFF):
        side = ti.select(determinant(F) < 0.0, -1.0, 1.0)
    block = ti.Matrix.zero(ti.f64, 3, 3)
    for k in range(3):  # a run-time loop, because three unrolled copies take minutes to compile
        along = ti.Vector([int(k == 0), int(k == 1), int(k == 2)]) + F[0] * 0.0
        G = product(product(transposed(RA), outer(along, gj)), A)
        in_axes, turn_in_axes = _parts(G, s)
        dU, turn = between(A, in_axes), between(A, turn_in_axes)
        dS = anisotropic_stress(_strain_change(model, U, dU), stiffness)
        d_area = _mixed_cofactor(U, dU)
        dQ = plus(product(dS, cofactor(U)), 1.0, product(S, d_area), 1.0)
        change = times(R, times(plus(product(turn, Q), 1.0, dQ, 1.0), gi)) * side
        for row in ti.static(range(3)):
            block[row, k] = change[row]
    a = ti.Vector([block[0, 0], block[1, 0], block[2, 0]])
    b = ti.Vector([block[0, 1], block[1, 1], block[2, 1]])
    c = ti.Vector([block[0, 2], block[1, 2], block[2, 2]])
    if ti.static(model.flips == Flips.RECOVER):
        if determinant(F) < 0.0:
            modulus = wave_modulus(stiffness)
            g, element = element_stiffness(model, F, (gi, gj, gi, gj), (modulus, modulus * 0.0), False)
            a, b, c = stiffness_block(element[0], g[0], g[1], element[1], element[2], element[3])
    return a, b, c


@ti.func
def _strain_change(model: ti.template(), U, dU):
    if ti.static(model.strain == Strain.EXACT):
        return dU
    else:
        return symmetric_part(product(U, dU))


@ti.func
def _parts(G, s):
    """Return dU and R^T dR in the axes of U, as columns. The top of this file defines G and the formulas."""
    least = 1e-9
    xy, xz, yz = ti.max(s.x + s.y, least), ti.max(s.x + s.z, least), ti.max(s.y + s.z, least)
    u_xy = (s.x * G[1].x + s.y * G[0].y) / xy
    u_xz = (s.x * G[2].x + s.z * G[0].z) / xz
    u_yz = (s.y * G[2].y + s.z * G[1].z) / yz
    w_xy, w_xz, w_yz = (G[1].x - G[0].y) / xy, (G[2].x - G[0].z) / xz, (G[2].y - G[1].z) / yz
    zero = s.x * 0.0
    dU = ti.Vector([G[0].x, u_xy, u_xz]), ti.Vector([u_xy, G[1].y, u_yz]), ti.Vector([u_xz, u_yz, G[2].z])
    turn = ti.Vector([zero, -w_xy, -w_xz]), ti.Vector([w_xy, zero, -w_yz]), ti.Vector([w_xz, w_yz, zero])
    return dU, turn


@ti.func
def _mixed_cofactor(M, N):
    """Derivative of the cofactor of M in the direction N, as columns."""
    return (
        M[1].cross(N[2]) + N[1].cross(M[2]),
        M[2].cross(N[0]) + N[2].cross(M[0]),
        M[0].cross(N[1]) + N[0].cross(M[1]),
    )


@ti.func
def pair_stiffness(F, gi, gj, stress, stiffness):
    """Negative derivative of the force -V F S g_i with respect to the position of vertex j, as columns [N/m].

    The matrix is F (B_i^T C B_j) F^T + (g_i . S g_j) I, where B_i maps a displacement of vertex i to strain.
    Args:
        gi, gj: rows of A^-1 that belong to the vertices, times the square root of the rest volume.
        stress: S, the result of `green_stress`, or the part of S to include, as columns.
        stiffness: C, see `anisotropic_stress`.
    """
    normal, mixed, shear = stiffness[0], stiffness[1], stiffness[2]
    Ti, Tj = _shear_of(gi), _shear_of(gj)
    # C B_j: normal and shear stress per displacement of the second vertex.
    a = _scaled_columns(normal, gj), product(mixed, Tj)
    b = _scaled_columns(transposed(mixed), gj), product(shear, Tj)
    N = (
        gi * (a[0][0] + a[1][0]) + times(Ti, b[0][0] + b[1][0]),
        gi * (a[0][1] + a[1][1]) + times(Ti, b[0][1] + b[1][1]),
        gi * (a[0][2] + a[1][2]) + times(Ti, b[0][2] + b[1][2]),
    )
    return scaled_plus_identity(between(F, N), 1.0, gi.dot(times(stress, gj)))


@ti.func
def _shear_of(g):
    """Matrix that maps a displacement of a vertex to engineering shear yz, xz, xy, as columns.

    Args:
        g: row of A^-1 that belongs to the vertex, see `pair_stiffness`.
    """
    zero = g.x * 0.0
    return ti.Vector([zero, g.z, g.y]), ti.Vector([g.z, zero, g.x]), ti.Vector([g.y, g.x, zero])


@ti.func
def _scaled_columns(columns, g):
    return columns[0] * g.x, columns[1] * g.y, columns[2] * g.z
