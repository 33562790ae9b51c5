"""Law of St. Venant-Kirchhoff: Hooke's law in the axes of the rest shape, with an energy.

The energy is psi = lambda/2 (tr E)^2 + mu E : E with Green's strain E = 1/2 (F^T F - I). The principal
strains are the same as in thesis eq. 6.7. But the stress in the thesis acts in the deformed directions and
per deformed area. This stress therefore has no energy, and section 6.4 observes a drift. F^T F is the same
for a mirror image, so a mirrored tetrahedron is at rest. Under strong compression, to a third of the length
along one axis, the law collapses.
"""

import numpy as np

from taichi_soft.core.math.tensors import inner_square, product, scaled_plus_identity
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.hooke import hooke_stress
from taichi_soft.elements.laws.principal import axis_of


@ti.func
def st_venant_kirchhoff_piola(F, lame_lambda, lame_mu):
    """First Piola-Kirchhoff stress P = F (lambda tr(E) I + 2 mu E) [Pa], as columns."""
    green = scaled_plus_identity(inner_square(F), 0.5, -0.5)
    return product(F, hooke_stress(green, lame_lambda, lame_mu))


@ti.func
def st_venant_kirchhoff_principal(s, lame_lambda, lame_mu):
    """Principal stress p_a = s_a (lambda tr E + 2 mu E_a) [Pa] of the stretches s, and dp/ds as columns."""
    green = 0.5 * (s * s - 1.0)
    stress = 2.0 * lame_mu * green + lame_lambda * green.sum()
    c0 = lame_lambda * s.x * s + axis_of(s, 0) * (stress.x + 2.0 * lame_mu * s.x * s.x)
    c1 = lame_lambda * s.y * s + axis_of(s, 1) * (stress.y + 2.0 * lame_mu * s.y * s.y)
    c2 = lame_lambda * s.z * s + axis_of(s, 2) * (stress.z + 2.0 * lame_mu * s.z * s.z)
    return s * stress, (c0, c1, c2)


def st_venant_kirchhoff_energy(F, lame_lambda, lame_mu):
    """Energy density psi [J/m^3], (m,), of deformations F (m, 3, 3), in NumPy."""
    green = 0.5 * (np.swapaxes(F, 1, 2) @ F - np.eye(3))
    trace = np.einsum("maa->m", green)
    return 0.5 * lame_lambda * trace**2 + lame_mu * np.einsum("mab,mab->m", green, green)
