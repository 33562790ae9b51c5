"""How the force between two particles changes as they move (thesis 3.5.3 and 4.2), with the corrections.

Eq. 3.21 to 3.23 and 4.6, 4.7 print diagonal matrices of a unit vector's components; right is the outer
product. Laws of chapter 4 hold the normals of their planes, as eq. 4.6 does: how these turn as particles move
is left out, and the matrices are 0.1 to 0.6 off the true ones, by the sum of squares. Implicit Euler comes to
rest in the same shapes by them; on its way it is less exact. A stretched spring resists turning as well:
(1 - l/r)(I - n n^T), which is negative where it is pressed.
"""

from taichi_soft.core.runtime import ti


@ti.func
def along_and_across(n, along, across):
    """along n n^T + across (I - n n^T), as columns; n of unit length, or zero."""
    gap = along - across
    c0, c1, c2 = n * (gap * n.x), n * (gap * n.y), n * (gap * n.z)
    c0.x += across
    c1.y += across
    c2.z += across
    return c0, c1, c2


@ti.func
def spring_stiffness(r, tension, constants, projected: ti.template()):
    """- d f_p / d p of a spring [N/m], as columns.

    Args:
        r: second end minus first [m].
        tension: whole pull of the ends on each other [N], of volumes round it too.
        constants: length at rest [m] and stiffness [N/m] in x and y.
        projected: leave out what a pressed spring releases by turning.
    """
    length = ti.max(ti.sqrt(r.dot(r)), 1e-15)
    across = tension / length
    if ti.static(projected):
        across = ti.max(across, 0.0)
    return along_and_across(r / length, constants.y, across)
