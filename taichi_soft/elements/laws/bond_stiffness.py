"""Derivatives of the force between two particles (thesis 3.5.3 and 4.2), with corrections.

Eq. 3.21 to 3.23 and 4.6, 4.7 print diagonal matrices of a unit vector's components; the outer product is
correct. Laws of chapter 4 keep the normals of their planes fixed, as eq. 4.6 does. The rotation of the
normals is neglected, and the matrices have an error of 0.1 to 0.6, by the sum of squares. Implicit Euler
converges to the same rest shapes with them, but is less exact on the way. A stretched spring also resists
rotation: (1
- l/r)(I
- n n^T), which is negative under compression.
"""

from taichi_soft.core.runtime import ti


@ti.func
def along_and_across(n, along, across):
    """along n n^T + across (I - n n^T), as columns; n of unit length, or zero."""
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
        tension: total pull of the ends on each other [N], including that of adjacent volumes.
        constants: length at rest [m] and stiffness [N/m] in x and y.
        projected: True leaves out the negative stiffness of a compressed spring against rotation.
    """
    length = ti.max(ti.sqrt(r.dot(r)), 1e-15)
    across = tension / length
    if ti.static(projected):
        across = ti.max(across, 0.0)
    return along_and_across(r / length, constants.y, across)
