"""Stress that turns a flipped tetrahedron right side out again.

F has principal stretches s0 >= s1 >= |s2|; where it is flipped, the last counts negative. Hooke's law takes
their strains, which go on past flat: s2 - 1 for the exact strain; s2 - 1/2 for the linear one, whose square
(eq. 6.7) has its minimum at zero and would stop pushing back there.

The laws multiply the stress of each axis by the area across it, and across axes 0 and 1 that area is negative
in a flipped tetrahedron: what should pull a stretched axis together would tear it apart. So their stress
changes sign here. At flat these areas are zero, so the force stays continuous.

This force has no energy; `kernels.flips` says what that asks for.
"""

from taichi_soft.laws.strain import from_axes, principal_stretches
from taichi_soft.runtime import ti
from taichi_soft.types import Strain


@ti.func
def recovering_stress(kind: ti.template(), F, lame_lambda, lame_mu):
    """Stress of a flipped tetrahedron [Pa], as columns; `kind` is the strain of the upright ones."""
    stretch, axes = principal_stretches(F)
    strain = stretch - 1.0
    if ti.static(kind == Strain.LINEAR):
        strain = 0.5 * (stretch * stretch - 1.0)
        strain.z = stretch.z - 0.5
    stress = 2.0 * lame_mu * strain + lame_lambda * strain.sum()
    stress.x, stress.y = -stress.x, -stress.y
    return from_axes(stress, axes)
