"""Vertex forces from stress by the virial theorem (thesis section 6.3).

The law solves sigma = 1/V sum x f^T for the forces that cause the deformation: [f1 f2 f3] = V sigma B^-T. The
equation is eq. 6.16 without its factor 2, which cancels against the kinetic energy. V B^-T is the cofactor
matrix of B divided by 6, so the law does not divide by the volume, and a flat tetrahedron is no special case.
The material responds with -f. With the printed factor 2, the forces would be twice as large. To get the
printed forces, double Young's modulus.
"""

from taichi_soft.core.math.tensors import cofactor, times
from taichi_soft.core.runtime import ti


@ti.func
def virial_forces(B, stress):
    """Forces on the four vertices of one tetrahedron [N]; they sum to zero.

    Args:
        B: deformed shape as columns [m].
        stress: Cauchy stress as columns [Pa].
    """
    C = cofactor(B)
    f1 = times(stress, C[0]) / -6.0
    f2 = times(stress, C[1]) / -6.0
    f3 = times(stress, C[2]) / -6.0
    return -(f1 + f2 + f3), f1, f2, f3
