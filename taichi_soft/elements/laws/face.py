"""Vertex forces from the stress on the faces of a tetrahedron (thesis section 6.2).

The force sigma n a of eq. 6.8 on a face is divided equally among the three vertices of the face. The material
responds with the opposite force.
"""

from taichi_soft.core.math.tensors import times
from taichi_soft.core.math.tetrahedron import area_vectors
from taichi_soft.core.runtime import ti


@ti.func
def face_forces(B, stress):
    """Forces on the four vertices of one tetrahedron [N]; they sum to zero (eq. 6.10).

    Args:
        B: deformed shape as columns [m].
        stress: Cauchy stress as columns [Pa].
    """
    n0, n1, n2, n3 = area_vectors(B)
    t0 = times(stress, n0) / -6.0
    t1 = times(stress, n1) / -6.0
    t2 = times(stress, n2) / -6.0
    t3 = times(stress, n3) / -6.0
    return t1 + t2 + t3, t0 + t2 + t3, t0 + t1 + t3, t0 + t1 + t2
