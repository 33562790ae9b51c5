"""What turns a flipped tetrahedron right side out again.

Hooke's laws lose their hold on a tetrahedron pressed flat: their forces are stress times deformed area, and
there only the area across the thinnest axis is left. Behind it they would have nothing to go on with. So a
flipped tetrahedron follows an energy of its own in the principal stretches s0 >= s1 >= -s2 > 0 of F,

    psi = M/2 ((s0 - 1)^2 + (s1 - 1)^2) + phi(s2),   phi' = M (s2 - 1), but from 0 at flat in a steep ramp,

with M the modulus of pressure waves, lambda + 2 mu. But for the ramp that is M/2 |F - R|^2 with R the nearest
rotation: corotated elasticity without lateral contraction, which would draw what is stretched along one axis
further inside out along another. A force with an energy drives nothing in circles.

The ramp is there because an upright tetrahedron that is stretched enough is drawn flat by its own lateral
contraction. Against a force that set in at once it would be thrown to and fro through flat, and gain
each time what that force does in the rest of a substep.
"""

from taichi_soft.core.math.svd import signed_svd
from taichi_soft.core.math.tensors import product, transposed
from taichi_soft.core.runtime import ti

RAMP = 1 / 16
"""Stretch inside out at which the ramp ends. Wider ones leave more tetrahedra at rest a little inside out."""


@ti.func
def recovering_principal(s, modulus):
    """p(s) = d psi / d s [Pa], and dp/ds of each axis, where s2 is negative."""
    steep = (1.0 + RAMP) / RAMP
    p, rate = s - 1.0, s * 0.0 + 1.0
    if s.z > -RAMP:
        p.z, rate.z = s.z * steep, rate.z * steep
    return p * modulus, rate * modulus


@ti.func
def recovering_piola(F, modulus):
    """P [Pa], as columns, of F with a negative determinant."""
    U, s, V = signed_svd(F)
    p, _ = recovering_principal(s, modulus)
    return product((U[0] * p.x, U[1] * p.y, U[2] * p.z), transposed(V))
