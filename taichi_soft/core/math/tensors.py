"""3x3 matrices as tuples of their three columns.

Taichi 1.7 expands `ti.Matrix` products into scalars early, but vector operations late. Algebra that is
written column by column therefore halves the compile time of every law without slowing the laws down.
"""

from taichi_soft.core.runtime import ti


@ti.func
def widened(v):
    """Append a zero to a vec3, because the processor loads and stores four numbers as one vector."""
    return ti.Vector([v.x, v.y, v.z, v.x * 0.0])


@ti.func
def times(columns, v):
    """Return the product of a matrix and a vector, vec3."""
    return columns[0] * v.x + columns[1] * v.y + columns[2] * v.z


@ti.func
def product(left, right):
    """Return the product of two matrices, as columns."""
    return times(left, right[0]), times(left, right[1]), times(left, right[2])


@ti.func
def outer_square(columns):
    """Return the symmetric matrix M M^T, as columns."""
    a, b, c = columns[0], columns[1], columns[2]
    return (
        a * a.x + b * b.x + c * c.x,
        a * a.y + b * b.y + c * c.y,
        a * a.z + b * b.z + c * c.z,
    )


@ti.func
def inner_square(columns):
    """Return the symmetric matrix M^T M, as columns."""
    a, b, c = columns[0], columns[1], columns[2]
    ab, bc, ca = a.dot(b), b.dot(c), c.dot(a)
    return ti.Vector([a.dot(a), ab, ca]), ti.Vector([ab, b.dot(b), bc]), ti.Vector([ca, bc, c.dot(c)])


@ti.func
def plus(left, s, right, t):
    """Return s times `left` plus t times `right`, as columns."""
    return left[0] * s + right[0] * t, left[1] * s + right[1] * t, left[2] * s + right[2] * t


@ti.func
def scaled_plus_identity(columns, factor, diagonal):
    """Return `factor` times a matrix plus `diagonal` times the identity, as columns."""
    return (
        columns[0] * factor + ti.Vector([diagonal, 0.0, 0.0]),
        columns[1] * factor + ti.Vector([0.0, diagonal, 0.0]),
        columns[2] * factor + ti.Vector([0.0, 0.0, diagonal]),
    )


@ti.func
def transposed(columns):
    """Return M^T, as columns."""
    a, b, c = columns[0], columns[1], columns[2]
    return ti.Vector([a.x, b.x, c.x]), ti.Vector([a.y, b.y, c.y]), ti.Vector([a.z, b.z, c.z])


@ti.func
def symmetric_part(columns):
    """Return 1/2 (M + M^T), as columns."""
    a, b, c = columns[0], columns[1], columns[2]
    xy, xz, yz = 0.5 * (b.x + a.y), 0.5 * (c.x + a.z), 0.5 * (c.y + b.z)
    return ti.Vector([a.x, xy, xz]), ti.Vector([xy, b.y, yz]), ti.Vector([xz, yz, c.z])


@ti.func
def trace(columns):
    """Return the sum of the diagonal of a matrix."""
    return columns[0].x + columns[1].y + columns[2].z


@ti.func
def determinant(columns):
    """Return the determinant of a matrix: the triple product of its columns."""
    return columns[0].dot(columns[1].cross(columns[2]))


@ti.func
def cofactor(columns):
    """Return the cofactor matrix det(M) M^-T, as columns.

    The computation needs no division, so the result is valid for singular matrices too.
    """
    return columns[1].cross(columns[2]), columns[2].cross(columns[0]), columns[0].cross(columns[1])


@ti.func
def outer(a, b):
    """Return a b^T, as columns."""
    return a * b.x, a * b.y, a * b.z
