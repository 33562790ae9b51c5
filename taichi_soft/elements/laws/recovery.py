"""Recovery of flipped tetrahedra.

Hooke's laws can hardly restore a tetrahedron that is pressed flat: their forces are stress times deformed
area, and only the area across the thinnest axis is left there. Beyond flat they would have no restoring
force. A flipped tetrahedron therefore follows a separate energy in the principal stretches s0 >= s1 >= -s2 >
0 of F,

    psi = M/2 ((s0 - 1)^2 + (s1 - 1)^2) + phi(s2),   phi' = M (s2 - 1), but from 0 at flat in a steep ramp,

with M the modulus of pressure waves, lambda + 2 mu. Without the ramp it is M/2 |F - R|^2 with R the nearest
rotation: corotated elasticity without lateral contraction, which would invert a tetrahedron stretched along
one axis further along another. A force with an energy cannot drive a cycle.

The ramp is there because an upright tetrahedron that is stretched enough becomes flat by its own lateral
contraction. A restoring force with a sudden onset would throw it back and forth through flat, and add the
work of that force in the rest of a substep each time.
"""

from taichi_soft.core.math.svd import signed_svd
from taichi_soft.core.math.tensors import product, transposed
from taichi_soft.core.runtime import ti

RAMP = 1 / 16
"""Inverted stretch at which the ramp ends. A wider ramp leaves more tetrahedra slightly inverted at rest."""


@ti.func
def recovering_principal(s, modulus):
    """p(s) = d psi / d s [Pa], and dp/ds of each axis, for negative s2."""
    steep = (1.0 + RAMP) / RAMP
    p, rate = s - 1.0, s * 0.0 + 1.0
    if s.z > -RAMP:
        p.z, rate.z = s.z * steep, rate.z * steep
    return p * modulus, rate * modulus


@ti.func
def recovering_piola(F, modulus):
    """P [Pa], as columns, for F with a negative determinant."""
    U, s, V = signed_svd(F)
    p, _ = recovering_principal(s, modulus)
    return product((U[0] * p.x, U[1] * p.y, U[2] * p.z), transposed(V))
