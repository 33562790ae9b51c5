"""Derivatives of the force between two particles (thesis 3.5.3 and 4.2), with corrections.

Eq. 3.21 to 3.23, 4.6 and 4.7 print diagonal matrices of a unit vector's components; the outer product is
correct. For laws of chapter 4, the matrices neglect the rotation of the planes' normals, as eq. 4.6 does.
Their error is 0.1 to 0.6, by the sum of squares. With them, implicit Euler converges to the same rest shapes,
but its motion is less exact. A stretched spring also resists rotation: (1 - l/r)(I - n n^T), which is
negative under compression.
"""

from taichi_soft.core.runtime import ti


@ti.func
def along_and_across(n, along, across):
    """Matrix along n n^T + across (I - n n^T), as columns; n has length 1 or is zero."""
    difference = along - across
    c0, c1, c2 = n * (difference * n.x), n * (difference * n.y), n * (difference * n.z)
    c0.x += across
    c1.y += across
    c2.z += across
    return c0, c1, c2


@ti.func
def spring_stiffness(r, tension, constants, projected: ti.template()):
    """- d f_p / d p of a spring [N/m], as columns.

    Args:
        r: second end minus first [m].
        tension: total pull of the ends on each other [N], including the pull of adjacent tetrahedra.
        constants: length at rest [m] and stiffness [N/m] in x and y.
        projected: True omits the negative stiffness of a compressed spring against rotation.
    """
    length = ti.max(ti.sqrt(r.dot(r)), 1e-15)
    across = tension / length
    if ti.static(projected):
        across = ti.max(across, 0.0)
    return along_and_across(r / length, constants.y, across)
