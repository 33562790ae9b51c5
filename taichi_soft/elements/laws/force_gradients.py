"""Derivatives of a tetrahedron's forces with respect to its vertices, for implicit integration.

The derivative of an isotropic law decouples in the axes of the singular value decomposition
F = U diag(s) V^T. It consists of a 3x3 block for the stretches, and of two numbers for each pair of axes:
(p_a - p_b)/(s_a - s_b) for shear, and (p_a + p_b)/(s_a + s_b) for rotation. Smith, de Goes and Kim 2019,
Analytic eigensystems for isotropic distortion energies, show this for laws with an energy. The derivatives of
other laws decouple too, but their block is not symmetric. Projection makes the block symmetric and removes
all negative values. The system is then positive definite for every pose, as conjugate gradients require.
"""

from taichi_soft.core.math.eigen import from_axes, symmetric_eigen
from taichi_soft.core.math.svd import signed_svd
from taichi_soft.core.math.tensors import determinant, symmetric_part, transposed
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.principal import hooke_principal

MIN_GAP = 2.0e-3
"""Two stretches count as equal if their relative difference is below this value. Otherwise, the shear
stiffness would be a quotient of round-off errors."""


@ti.func
def principal(model: ti.template(), s, lame_lambda, lame_mu):
    """Principal stress p(s) [Pa] of the model's law and its derivatives dp/ds, as columns."""
    if ti.static(model.has_energy):
        return model.law.principal(s, lame_lambda, lame_mu)
    else:
        return hooke_principal(model, s, lame_lambda, lame_mu)


@ti.func
def positive_part(columns):
    """Positive semi-definite matrix nearest to the symmetric part of a matrix, as columns."""
    values, axes = symmetric_eigen(symmetric_part(columns))
    return from_axes(ti.max(values, 0.0), axes)


@ti.func
def shear_and_rotation(sa, sb, pa, pb, along, largest, projected: ti.template()):
    """Return alpha and beta of a pair of axes [Pa].

    alpha is half the sum of the stiffness against shear and the stiffness against rotation. beta is half the
    difference, shear minus rotation.
    Args:
        sa, sb: stretches along the two axes, with sa >= |sb| as `signed_svd` orders them.
        pa, pb: principal stresses along the two axes [Pa].
        along: shear stiffness in the limit of equal stretches [Pa].
        largest: upper limit of the rotation stiffness [Pa]. Near sa = -sb, the rotation stiffness is a
            quotient of round-off errors.
    """
    gap, total = sa - sb, sa + sb
    shear = along
    if gap > MIN_GAP * sa:
        shear = (pa - pb) / gap
    rotation = (pa + pb) / ti.max(total, 1e-9)
    if ti.static(projected):
        shear = ti.max(shear, 0.0)
        rotation = ti.min(ti.max(rotation, 0.0), largest)
    return 0.5 * (shear + rotation), 0.5 * (shear - rotation)


@ti.func
def weighted_rows(rest_inverse):
    """Return the row of A^-1 for each vertex, times the square root of the rest volume, as four vec3.

    The rows of A^-1 map displacements of the vertices to changes of F. For padding lanes, all rows are zero.
    """
    root = 1.0 / ti.sqrt(6.0 * ti.max(determinant(rest_inverse), 1e-37))
    rows = transposed(rest_inverse)
    g1, g2, g3 = rows[0] * root, rows[1] * root, rows[2] * root
    return -(g1 + g2 + g3), g1, g2, g3


@ti.func
def element_stiffness(model: ti.template(), F, rows, elasticity, projected: ti.template()):
    """Compute the arguments of `stiffness_block`: rows in the axes of V, and the tuple (U, M, alpha, beta).

    Args:
        rows: result of `weighted_rows`.
        elasticity: lambda and mu [Pa].
        projected: True makes the stiffness symmetric and positive semi-definite.
    """
    lame_lambda, lame_mu = elasticity[0], elasticity[1]
    U, s, V = signed_svd(F)
    p, M = principal(model, s, lame_lambda, lame_mu)
    largest = 10.0 * (2.0 * lame_mu + ti.abs(lame_lambda))
    yz = 0.5 * (M[1].y - M[2].y + M[2].z - M[1].z)
    xz = 0.5 * (M[0].x - M[2].x + M[2].z - M[0].z)
    xy = 0.5 * (M[0].x - M[1].x + M[1].y - M[0].y)
    ax, bx = shear_and_rotation(s.y, s.z, p.y, p.z, yz, largest, projected)
    ay, by = shear_and_rotation(s.x, s.z, p.x, p.z, xz, largest, projected)
    az, bz = shear_and_rotation(s.x, s.y, p.x, p.y, xy, largest, projected)
    m0, m1, m2 = M[0], M[1], M[2]
    if ti.static(projected):
        m0, m1, m2 = positive_part((m0, m1, m2))
    rotated_rows = _in_axes(V, rows[0]), _in_axes(V, rows[1]), _in_axes(V, rows[2]), _in_axes(V, rows[3])
    return rotated_rows, (U, (m0, m1, m2), ti.Vector([ax, ay, az]), ti.Vector([bx, by, bz]))


@ti.func
def _in_axes(V, g):
    return ti.Vector([V[0].dot(g), V[1].dot(g), V[2].dot(g)])


@ti.func
def stiffness_block(U, gi, gj, M, alpha, beta):
    """Negative derivative of the force on vertex i with respect to the position of vertex j.

    Args:
        gi, gj: rows of the two vertices from `element_stiffness`.
    Returns: columns [N/m].
    """
    both = gi * gj
    shear = alpha.x * ti.Vector([0.0, both.z, both.y])
    shear += alpha.y * ti.Vector([both.z, 0.0, both.x])
    shear += alpha.z * ti.Vector([both.y, both.x, 0.0])
    # Block in the axes of U: rows for the first vertex, columns for the second.
    b00, b11, b22 = (
        M[0].x * both.x + shear.x,
        M[1].y * both.y + shear.y,
        M[2].z * both.z + shear.z,
    )
    b10 = M[0].y * gi.y * gj.x + beta.z * gi.x * gj.y
    b01 = M[1].x * gi.x * gj.y + beta.z * gi.y * gj.x
    b20 = M[0].z * gi.z * gj.x + beta.y * gi.x * gj.z
    b02 = M[2].x * gi.x * gj.z + beta.y * gi.z * gj.x
    b21 = M[1].z * gi.z * gj.y + beta.x * gi.y * gj.z
    b12 = M[2].y * gi.y * gj.z + beta.x * gi.z * gj.y
    # U B U^T; c0, c1, c2 are the columns of U B.
    c0 = U[0] * b00 + U[1] * b10 + U[2] * b20
    c1 = U[0] * b01 + U[1] * b11 + U[2] * b21
    c2 = U[0] * b02 + U[1] * b12 + U[2] * b22
    return (
        c0 * U[0].x + c1 * U[1].x + c2 * U[2].x,
        c0 * U[0].y + c1 * U[1].y + c2 * U[2].y,
        c0 * U[0].z + c1 * U[1].z + c2 * U[2].z,
    )
