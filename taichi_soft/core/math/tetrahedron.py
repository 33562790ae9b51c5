"""Geometry of one tetrahedron."""

from taichi_soft.core.runtime import ti


@ti.func
def shape(x0, x1, x2, x3):
    """Return the edges from the first vertex to the others, as columns [m] (thesis eq. 6.1 and 6.2)."""
    return x1 - x0, x2 - x0, x3 - x0


@ti.func
def area_vectors(B):
    """Return twice the outward area vectors of the faces opposite to vertices 0 to 3 [m^2].

    See thesis eq. 6.8. For an inverted tetrahedron, the vectors point inward. The sum of the four vectors is
    zero (eq. 6.9).
    """
    n1 = B[2].cross(B[1])
    n2 = B[0].cross(B[2])
    n3 = B[1].cross(B[0])
    n0 = (B[1] - B[0]).cross(B[2] - B[0])
    return n0, n1, n2, n3
