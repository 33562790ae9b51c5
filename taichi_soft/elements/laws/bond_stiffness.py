"""Derivatives of the force between two particles (thesis 3.5.3 and 4.2), with corrections.

Eq. 3.21 to 3.23, 4.6 and 4.7 print a diagonal matrix of the components of a unit vector. The correct matrix
is the outer product of the vector with itself. For laws of chapter 4, the derivatives in this file neglect
the rotation of the planes' normals, as eq. 4.6 does. The relative error, by the sum of squares, is 0.1 to
0.6. Implicit Euler still converges to the same rest shapes, but the motion is less exact. A stretched spring
also resists rotation. The term for rotation, (1 - l/r)(I - n n^T), is negative under compression.
"""

from taichi_soft.core.runtime import ti


@ti.func
def along_and_across(n, along, across):
    """Matrix `along` n n^T + `across` (I - n n^T), as columns. n has length 1 or is zero."""
    difference = along - across
    c0, c1, c2 = n * (difference * n.x), n * (difference * n.y), n * (difference * n.z)
    c0.x += across
    c1.y += across
    c2.z += across
    return c0, c1, c2


@ti.func
def spring_stiffness(r, tension, constants, projected: ti.template()):
    """Negative derivative of a spring's force on its first end with respect to the position of this end.

    Args:
        r: second end minus first end [m].
        tension: total pull of the ends on each other [N], including the pull of adjacent tetrahedra.
        constants: length at rest [m] and stiffness [N/m] in x and y.
        projected: True replaces the negative stiffness of a compressed spring against rotation by zero.
    Returns: columns [N/m].
    """
    length = ti.max(ti.sqrt(r.dot(r)), 1e-15)
    across = tension / length
    if ti.static(projected):
        across = ti.max(across, 0.0)
    return along_and_across(r / length, constants.y, across)
