"""Hooke's law of materials that are not the same in all directions (thesis eq. 2.25, chapter 7).

Their stiffness is known in the axes of the rest shape, so the strain has to be known there as well: besides
the stretch U of F = U R it takes the rotation R, which isotropic laws do not need.
"""

from taichi_soft.core.math.polar import orthogonal_factor
from taichi_soft.core.math.tensors import (
    inner_square,
    product,
    scaled_plus_identity,
    symmetric_part,
    times,
    transposed,
)
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Strain


@ti.func
def anisotropic_stress(strain, stiffness):
    """sigma = C : eps [Pa], as columns.

    Args:
        strain: symmetric, as columns.
        stiffness: C in Voigt's order and with engineering shear, as three matrices in columns: normal
            stress by normal strain, normal stress by shear strain, shear stress by shear strain.
    """
    normal, mixed, shear = stiffness[0], stiffness[1], stiffness[2]
    e = ti.Vector([strain[0].x, strain[1].y, strain[2].z])
    g = ti.Vector([strain[1].z, strain[0].z, strain[0].y]) * 2.0
    s = times(normal, e) + times(mixed, g)
    t = times(transposed(mixed), e) + times(shear, g)
    return ti.Vector([s.x, t.z, t.y]), ti.Vector([t.z, s.y, t.x]), ti.Vector([t.y, t.x, s.z])


@ti.func
def green_stress(F, stiffness):
    """C : 1/2 (F^T F - I) [Pa], as columns, in the axes of the rest shape."""
    return anisotropic_stress(scaled_plus_identity(inner_square(F), 0.5, -0.5), stiffness)


@ti.func
def turned_stress(model: ti.template(), F, stiffness):
    """Stress R (C : R^T eps R) R^T of the strain that the model names [Pa], as columns.

    In a mirrored tetrahedron R mirrors too, so that its stress is that of the mirror image.
    """
    R = orthogonal_factor(F)
    if ti.static(model.strain == Strain.EXACT):
        stretch = symmetric_part(product(transposed(R), F))
        return _between(R, anisotropic_stress(scaled_plus_identity(stretch, 1.0, -1.0), stiffness))
    else:
        return _between(R, green_stress(F, stiffness))


@ti.func
def _between(M, columns):
    """M N M^T."""
    return product(product(M, columns), transposed(M))


@ti.func
def wave_modulus(stiffness):
    """What pressure waves meet, the mean over all directions [Pa]: 1/15 (C_iijj + 2 C_ijij)."""
    normal, shear = stiffness[0], stiffness[2]
    along = normal[0].x + normal[1].y + normal[2].z
    lateral = normal[1].x + normal[2].x + normal[2].y
    return (3.0 * along + 2.0 * lateral + 4.0 * (shear[0].x + shear[1].y + shear[2].z)) / 15.0


@ti.func
def pair_stiffness(F, gi, gj, stress, stiffness):
    """- d f_i / d x_j of two vertices [N/m], as columns, of forces -V F S g_i with S = `green_stress`.

    F (B_i^T C B_j) F^T + (g_i . S g_j) I, where B_i takes a move of the vertex to strain.
    Args:
        gi, gj: rows of A^-1 that belong to the vertices, times the root of the rest volume.
        stress: S as columns, or the part of it that is let count.
    """
    normal, mixed, shear = stiffness[0], stiffness[1], stiffness[2]
    Ti, Tj = _shear_of(gi), _shear_of(gj)
    # C B_j: normal and shear stress by a move of the second vertex.
    a = _scaled_columns(normal, gj), product(mixed, Tj)
    b = _scaled_columns(transposed(mixed), gj), product(shear, Tj)
    N = (
        gi * (a[0][0] + a[1][0]) + times(Ti, b[0][0] + b[1][0]),
        gi * (a[0][1] + a[1][1]) + times(Ti, b[0][1] + b[1][1]),
        gi * (a[0][2] + a[1][2]) + times(Ti, b[0][2] + b[1][2]),
    )
    return scaled_plus_identity(_between(F, N), 1.0, gi.dot(times(stress, gj)))


@ti.func
def _shear_of(g):
    """Engineering shear yz, xz, xy by a move, as columns."""
    zero = g.x * 0.0
    return ti.Vector([zero, g.z, g.y]), ti.Vector([g.z, zero, g.x]), ti.Vector([g.y, g.x, zero])


@ti.func
def _scaled_columns(columns, g):
    return columns[0] * g.x, columns[1] * g.y, columns[2] * g.z
