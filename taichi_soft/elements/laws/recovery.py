"""Recovery of flipped tetrahedra.

Laws with Hooke's stress can hardly restore a tetrahedron that is pressed flat. Their forces are stress times
deformed area, and only the area across the thinnest axis remains. For a flipped tetrahedron, these laws have
no restoring force. A flipped tetrahedron therefore gets a separate energy psi. With the principal stretches
s0 >= s1 >= -s2 > 0 of F, this energy is

    psi = M/2 ((s0 - 1)^2 + (s1 - 1)^2) + phi(s2),   phi' = M (s2 - 1) after a steep ramp from 0 at s2 = 0.

M = lambda + 2 mu is the modulus of pressure waves. Without the ramp, psi is M/2 |F - R|^2 with the
nearest rotation R: corotated elasticity without lateral contraction. With lateral contraction, a stretch
along one axis would invert a tetrahedron further along another axis. Because the force is the derivative of
an energy, a cycle adds no energy.

The ramp is necessary because an upright tetrahedron that is stretched enough becomes flat by its own lateral
contraction. A force with a sudden onset would move the tetrahedron back and forth through the flat shape.
Each passage would add energy: the work of the force during the rest of a substep.
"""

from taichi_soft.core.math.svd import signed_svd
from taichi_soft.core.math.tensors import product, transposed
from taichi_soft.core.runtime import ti

RAMP = 1 / 16
"""Value of -s2 at which the ramp ends. A wider ramp leaves more tetrahedra slightly inverted at rest."""


@ti.func
def recovering_principal(s, modulus):
    """Return the principal stress p(s) = d psi / d s [Pa] for negative s2, and dp_a/ds_a for each axis."""
    steep = (1.0 + RAMP) / RAMP
    p, rate = s - 1.0, s * 0.0 + 1.0
    if s.z > -RAMP:
        p.z, rate.z = s.z * steep, rate.z * steep
    return p * modulus, rate * modulus


@ti.func
def recovering_piola(F, modulus):
    """First Piola-Kirchhoff stress P [Pa], as columns, for F with a negative determinant."""
    U, s, V = signed_svd(F)
    p, _ = recovering_principal(s, modulus)
    return product((U[0] * p.x, U[1] * p.y, U[2] * p.z), transposed(V))
