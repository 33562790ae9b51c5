"""Best-fitting rigid motion between two sets of vertices, in 64-bit floats.

If all vertices lie on a line, rounding errors would determine the rotation about the line. A small weight in
favour of no rotation prevents this.
"""

from taichi_soft.core.math.rows import row_at
from taichi_soft.core.runtime import ti

REGULARISATION = 1e-10
"""Weight in favour of no rotation. It affects only rotations that the vertices do not determine."""

SWEEPS = 30
"""Number of Jacobi sweeps over all pairs of axes. Pairs whose off-diagonal entry is zero are skipped."""

RESIDUE = 1e-12
"""Numbers below this fraction of the largest number count as rounding errors and are set to zero."""


@ti.func
def kept(v):
    """Set rounding residues of a vec3 to zero, and round it to 32-bit floats, as a world stores numbers."""
    size = ti.abs(v).max()
    for k in ti.static(range(3)):
        v[k] = ti.select(ti.abs(v[k]) > RESIDUE * size, ti.cast(ti.cast(v[k], ti.f32), ti.f64), 0.0)
    return v


@ti.func
def fitting_motion(rest: ti.template(), now: ti.template(), column, weights: ti.template()):
    """Return the rotation (3, 3) and the translation [m] that best map the rows of `rest` to rows of `now`.

    Args:
        rest: positions at rest [m].
        now: array with the current positions [m] in the three columns from `column` on.
        column: first column of `now` to read.
        weights: weight of each row, with sum 1.
    """
    rest_center, center = ti.Vector.zero(ti.f64, 3), ti.Vector.zero(ti.f64, 3)
    for i in range(weights.shape[0]):
        rest_center += weights[i] * row_at(rest, i, 0)
        center += weights[i] * row_at(now, i, column)
    covariance, spread = ti.Matrix.zero(ti.f64, 3, 3), ti.Vector.zero(ti.f64, 3)
    for i in range(weights.shape[0]):
        offset = row_at(rest, i, 0) - rest_center
        covariance += (weights[i] * (row_at(now, i, column) - center)).outer_product(offset)
        spread += weights[i] * offset * offset
    for k in ti.static(range(3)):
        covariance[k, k] += REGULARISATION * (spread.x + spread.y + spread.z)
    rotation = _nearest_rotation(covariance)
    return rotation, center - rotation @ rest_center


@ti.func
def _nearest_rotation(m):
    """Return the rotation R with the largest trace of R^T m (Horn 1987); the identity for m = 0."""
    a = ti.Matrix(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    vectors = ti.Matrix.identity(ti.f64, 4)
    for _ in range(SWEEPS):
        for p, q in ti.static(((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))):
            if a[p, q] != 0.0:  # rotate axes p and q so that this entry becomes zero up to rounding
                slope = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
                t = ti.select(slope < 0.0, -1.0, 1.0) / (ti.abs(slope) + ti.sqrt(slope * slope + 1.0))
                c = 1.0 / ti.sqrt(t * t + 1.0)
                s = t * c
                for k in ti.static(range(4)):
                    x, y = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * x - s * y, s * x + c * y
                for k in ti.static(range(4)):
                    x, y = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * x - s * y, s * x + c * y
                for k in ti.static(range(4)):
                    x, y = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * x - s * y, s * x + c * y
    best, largest = ti.Vector([vectors[k, 3] for k in ti.static(range(4))]), a[3, 3]
    for i in ti.static(range(3)):
        if a[i, i] > largest:
            best, largest = ti.Vector([vectors[k, i] for k in ti.static(range(4))]), a[i, i]
    best /= ti.sqrt(best.x * best.x + best.y * best.y + best.z * best.z + best.w * best.w)
    x, y, z, w = best.x, best.y, best.z, best.w
    return ti.Matrix(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
