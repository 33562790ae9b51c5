"""Vertex forces from the derivative of an energy with respect to the deformation.

The energy of a tetrahedron is its volume at rest V0 times a density psi(F). F = B A^-1 (thesis eq. 6.3) is
linear in the vertices. The force on vertex i is therefore f_i = -V0 P r_i. P = d psi / d F is the first
Piola-Kirchhoff stress, and r_i is the i-th row of A^-1.
"""

from taichi_soft.core.math.tensors import determinant, times
from taichi_soft.core.runtime import ti


@ti.func
def energy_forces(piola, rest_inverse):
    """Forces on the four vertices of one tetrahedron [N]; they sum to zero.

    Args:
        piola: P as columns [Pa].
        rest_inverse: A^-1 as columns [1/m]; all zero for padding lanes, which have no volume.
    """
    a, b, c = rest_inverse[0], rest_inverse[1], rest_inverse[2]
    inverse_volume6 = determinant(rest_inverse)
    volume = ti.select(inverse_volume6 > 0.0, 1.0 / (6.0 * inverse_volume6), 0.0)
    f1 = times(piola, ti.Vector([a.x, b.x, c.x])) * -volume
    f2 = times(piola, ti.Vector([a.y, b.y, c.y])) * -volume
    f3 = times(piola, ti.Vector([a.z, b.z, c.z])) * -volume
    return -(f1 + f2 + f3), f1, f2, f3
