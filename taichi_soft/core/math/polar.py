"""The rotation in a 3x3 matrix: R of the polar decomposition F = U R."""

from taichi_soft.core.math.tensors import cofactor, determinant, plus
from taichi_soft.core.runtime import ti

ROUNDS = 6
"""Five reach float32, six float64, also for flat matrices (a 10^8 th of their size across)."""


@ti.func
def orthogonal_factor(F):
    """The orthogonal matrix nearest to F, as columns: a rotation, or one that mirrors where F does.

    Newton's iteration for the polar decomposition with scaling by norms (Higham 1986), in cofactors instead
    of inverses: F and cof F have the same singular vectors, and their sum evens out the singular values. So
    flat matrices are no special case, and without branches the lanes of a block go side by side. What has
    shrunk to a line has no such matrix; then the result is finite and means nothing.
    """
    a, b, c = F[0], F[1], F[2]
    side = ti.select(determinant(F) < 0.0, -1.0, 1.0)
    for _ in ti.static(range(ROUNDS)):
        columns = (a, b, c)
        others = cofactor(columns)
        a, b, c = plus(columns, _inverse_norm(columns), others, side * _inverse_norm(others))
    unit = _inverse_norm((a, b, c)) * ti.sqrt(a.x * 0.0 + 3.0)
    return a * unit, b * unit, c * unit


@ti.func
def _inverse_norm(columns):
    a, b, c = columns[0], columns[1], columns[2]
    return 1.0 / ti.sqrt(ti.max(a.dot(a) + b.dot(b) + c.dot(c), 1e-30))
