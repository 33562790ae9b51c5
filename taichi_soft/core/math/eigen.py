"""Compute eigenvalues and eigenvectors of a symmetric 3x3 matrix by cyclic Jacobi rotations.

The Jacobi method is accurate even if eigenvalues are equal, as in a body at rest. Closed formulas in float32
are not accurate in this case (Golub and Van Loan, Matrix Computations, section 8.5).
"""

from taichi_soft.core.runtime import ti

SWEEPS = 6
"""Number of sweeps. Convergence is quadratic: four sweeps are enough for float32, six for float64."""

NOTHING = 1e-17
"""Off-diagonal entries below this fraction of the diagonal entries are skipped. A rotation would not change
the diagonal, even in float64."""


@ti.func
def symmetric_eigen(columns):
    """Return the eigenvalues in descending order, and a right-handed set of unit eigenvectors.

    Args:
        columns: symmetric 3x3 matrix as columns.
    Returns: vec3 of eigenvalues; eigenvectors as columns.
    """
    S = ti.Matrix.cols([columns[0], columns[1], columns[2]])
    Q = ti.Matrix.cols([columns[0] * 0.0, columns[1] * 0.0, columns[2] * 0.0])
    for i in ti.static(range(3)):
        Q[i, i] += 1.0
    for _ in range(SWEEPS):
        for p, q in ti.static(((0, 1), (0, 2), (1, 2))):
            r = 3 - p - q
            apq = S[p, q]
            if ti.abs(apq) > NOTHING * (ti.abs(S[p, p]) + ti.abs(S[q, q])):
                theta = (S[q, q] - S[p, p]) / (2.0 * apq)
                t = 1.0 / (ti.abs(theta) + ti.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / ti.sqrt(t * t + 1.0)
                s = t * c
                S[p, p] -= t * apq
                S[q, q] += t * apq
                S[p, q] = apq * 0.0
                S[q, p] = apq * 0.0
                srp, srq = S[r, p], S[r, q]
                S[r, p] = c * srp - s * srq
                S[p, r] = S[r, p]
                S[r, q] = s * srp + c * srq
                S[q, r] = S[r, q]
                for k in ti.static(range(3)):
                    qkp, qkq = Q[k, p], Q[k, q]
                    Q[k, p] = c * qkp - s * qkq
                    Q[k, q] = s * qkp + c * qkq

    values = ti.Vector([S[0, 0], S[1, 1], S[2, 2]])
    a = ti.Vector([Q[0, 0], Q[1, 0], Q[2, 0]])
    b = ti.Vector([Q[0, 1], Q[1, 1], Q[2, 1]])
    if values.x < values.y:
        values = values.yxz
        a, b = b, a
    c = a.cross(b)
    if values.y < values.z:
        values = values.xzy
        b, c = c, b
    if values.x < values.y:
        values = values.yxz
        a, b = b, a
    return values, (a, b, a.cross(b))


@ti.func
def from_axes(values, axes):
    """Return the symmetric matrix with these eigenvalues (vec3) and unit eigenvectors, as columns."""
    a, b, c = axes[0] * values.x, axes[1] * values.y, axes[2] * values.z
    return (
        a * axes[0].x + b * axes[1].x + c * axes[2].x,
        a * axes[0].y + b * axes[1].y + c * axes[2].y,
        a * axes[0].z + b * axes[1].z + c * axes[2].z,
    )
