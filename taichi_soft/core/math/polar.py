"""Compute the rotation R of the polar decomposition F = U R of a 3x3 matrix."""

from taichi_soft.core.math.tensors import cofactor, determinant, plus
from taichi_soft.core.runtime import ti

ROUNDS = 6
"""Number of iterations. Five are enough for float32 and six for float64, even for flat matrices (aspect ratio
10^8)."""


@ti.func
def orthogonal_factor(F):
    """Return the orthogonal matrix nearest to F, as columns: a rotation, or a reflection if F mirrors.

    The method is Newton's iteration for the polar decomposition, scaled by norms (Higham 1986), but with
    cofactors instead of inverses. F and cof F have the same singular vectors, and their sum has singular
    values that are closer together. Flat matrices need no branch, so the code can be vectorised. For a matrix
    of rank 1, the result is finite but arbitrary.
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
