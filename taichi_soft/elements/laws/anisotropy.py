"""Hooke's law for anisotropic materials (thesis eq. 2.25, chapter 7).

The stiffness is defined in the axes of the rest shape, so the law needs the strain in the same axes. For this
strain, the law needs the rotation R of F = U R in addition to the stretch U. Isotropic laws do not need R.
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
    """Stress sigma = C : eps [Pa], as columns.

    Args:
        strain: symmetric, as columns.
        stiffness: C in Voigt's order with engineering shear [Pa], as three 3x3 matrices of columns. The first
            matrix maps normal strain to normal stress, the second maps shear strain to normal stress, and the
            third maps shear strain to shear stress.
    """
    normal, mixed, shear = stiffness[0], stiffness[1], stiffness[2]
    e = ti.Vector([strain[0].x, strain[1].y, strain[2].z])
    g = ti.Vector([strain[1].z, strain[0].z, strain[0].y]) * 2.0
    s = times(normal, e) + times(mixed, g)
    t = times(transposed(mixed), e) + times(shear, g)
    return ti.Vector([s.x, t.z, t.y]), ti.Vector([t.z, s.y, t.x]), ti.Vector([t.y, t.x, s.z])


@ti.func
def green_stress(F, stiffness):
    """Stress C : 1/2 (F^T F - I) in the axes of the rest shape [Pa], as columns."""
    return anisotropic_stress(scaled_plus_identity(inner_square(F), 0.5, -0.5), stiffness)


@ti.func
def turned_stress(model: ti.template(), F, stiffness):
    """Stress R (C : R^T eps R) R^T in world axes [Pa], as columns, for the model's strain eps.

    In a mirrored tetrahedron, R includes the reflection, so the stress equals the stress of the mirror image.
    """
    R = orthogonal_factor(F)
    if ti.static(model.strain == Strain.EXACT):
        stretch = symmetric_part(product(transposed(R), F))
        return between(R, anisotropic_stress(scaled_plus_identity(stretch, 1.0, -1.0), stiffness))
    else:
        return between(R, green_stress(F, stiffness))


@ti.func
def between(M, columns):
    """Return M N M^T, as columns. N is the matrix `columns`."""
    return product(product(M, columns), transposed(M))


@ti.func
def wave_modulus(stiffness):
    """Modulus of pressure waves, averaged over all directions [Pa]: 1/15 (C_iijj + 2 C_ijij)."""
    normal, shear = stiffness[0], stiffness[2]
    along = normal[0].x + normal[1].y + normal[2].z
    lateral = normal[1].x + normal[2].x + normal[2].y
    return (3.0 * along + 2.0 * lateral + 4.0 * (shear[0].x + shear[1].y + shear[2].z)) / 15.0
