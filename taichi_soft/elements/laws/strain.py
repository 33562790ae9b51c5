"""Strain of a tetrahedron in its deformed orientation (thesis section 6.1).

F = U R maps the rest shape to the deformed shape. F F^T = U^2 contains no rotation. All functions take F as
columns and return a symmetric 3x3 strain as columns.
"""

from taichi_soft.core.math.polar import orthogonal_factor
from taichi_soft.core.math.tensors import (
    outer_square,
    product,
    scaled_plus_identity,
    symmetric_part,
    transposed,
)
from taichi_soft.core.runtime import ti


@ti.func
def linear_strain(F):
    """Linear strain 1/2 (F F^T - I), thesis eq. 6.7.

    The linear strain equals (U - I) + 1/2 (U - I)^2, so it is exact to first order.
    """
    return scaled_plus_identity(outer_square(F), 0.5, -0.5)


@ti.func
def exact_strain(F):
    """Exact strain U - I with U = sqrt(F F^T) = F R^T. Thesis chapter 7 leaves it as an open question.

    A mirrored F has the same strain.
    """
    return scaled_plus_identity(symmetric_part(product(F, transposed(orthogonal_factor(F)))), 1.0, -1.0)
