"""Signed singular value decomposition of a 3x3 matrix, and the rotation nearest to the matrix."""

from taichi_soft.core.math.eigen import symmetric_eigen
from taichi_soft.core.math.tensors import inner_square, times
from taichi_soft.core.runtime import ti


@ti.func
def signed_svd(F):
    """Decompose F = U diag(s) V^T with rotations U and V, s0 >= s1 >= |s2|, and s2 negative if F mirrors.

    U is computed from the images of V's columns. U is therefore a rotation even for a flat or zero F.
    Args:
        F: matrix as columns.
    Returns: U as columns, s as vec3, V as columns.
    """
    _, V = symmetric_eigen(inner_square(F))
    a = times(F, V[0])
    s0 = ti.sqrt(a.dot(a))
    u0 = ti.select(s0 > 1e-20, a / ti.max(s0, 1e-20), V[0])
    b = times(F, V[1])
    b = b - u0 * u0.dot(b)
    s1 = ti.sqrt(b.dot(b))
    u1 = b / ti.max(s1, 1e-30)
    if s1 <= 1e-6 * s0:  # b has no direction: use any vector perpendicular to u0
        u1 = u0.cross(V[1])
        if u1.dot(u1) < 0.1:
            u1 = u0.cross(V[2])
        u1 = u1 / ti.sqrt(u1.dot(u1))
    u2 = u0.cross(u1)
    return (u0, u1, u2), ti.Vector([s0, s1, u2.dot(times(F, V[2]))]), V


@ti.func
def nearest_rotation(F):
    """Return the rotation nearest to F: U V^T for F = U S V^T, as rows.

    Args:
        F: matrix as columns.
    """
    U, _, V = signed_svd(F)
    return (
        U[0].x * V[0] + U[1].x * V[1] + U[2].x * V[2],
        U[0].y * V[0] + U[1].y * V[1] + U[2].y * V[2],
        U[0].z * V[0] + U[1].z * V[1] + U[2].z * V[2],
    )
