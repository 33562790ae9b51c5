"""Stable neo-Hookean material, after Smith, de Goes and Kim, Stable Neo-Hookean Flesh Simulation (2018).

The energy psi = m/2 (I - 3) + l/2 (J - a)^2 - m/2 log(I + 1), with I = F : F and J = det F, is finite and
smooth for every pose. The energy restores flat and flipped tetrahedra. A tetrahedron that is shrunk to a
point is in unstable equilibrium. With m = 4/3 mu, l = lambda + 5/6 mu and a = 1 + mu/l, the law equals
Hooke's law for small strain (section 3.4 of the paper).
"""

import numpy as np

from taichi_soft.core.math.tensors import cofactor, determinant, plus
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.principal import axis_of, cofactors


@ti.func
def neo_hookean_piola(F, lame_lambda, lame_mu):
    """First Piola-Kirchhoff stress P = m (1 - 1/(I + 1)) F + l (J - a) cof F [Pa], as columns."""
    square = F[0].dot(F[0]) + F[1].dot(F[1]) + F[2].dot(F[2])
    # Taichi would round a factor 4 / 3 to float32 even in float64 code. The numbers 4 and 3 are exact.
    along = lame_mu * 4.0 / 3.0 * (1.0 - 1.0 / (square + 1.0))
    pressure = (lame_lambda + lame_mu * 5.0 / 6.0) * (determinant(F) - 1.0) - lame_mu
    return plus(F, along, cofactor(F), pressure)


@ti.func
def neo_hookean_principal(s, lame_lambda, lame_mu):
    """Principal stress p [Pa] of the stretches s, and dp/ds as columns."""
    soft = lame_mu * 4.0 / 3.0
    bulk = lame_lambda + lame_mu * 5.0 / 6.0
    square = s.dot(s) + 1.0
    along = soft * (1.0 - 1.0 / square)
    pressure = bulk * (s.x * s.y * s.z - 1.0) - lame_mu
    others, changes = cofactors(s)
    bend = 2.0 * soft / (square * square)
    c0 = axis_of(s, 0) * along + s * (bend * s.x) + others * (bulk * others.x) + changes[0] * pressure
    c1 = axis_of(s, 1) * along + s * (bend * s.y) + others * (bulk * others.y) + changes[1] * pressure
    c2 = axis_of(s, 2) * along + s * (bend * s.z) + others * (bulk * others.z) + changes[2] * pressure
    return s * along + others * pressure, (c0, c1, c2)


def neo_hookean_energy(F, lame_lambda, lame_mu):
    """Energy density psi [J/m^3] minus its value at rest, (m,), of deformations F (m, 3, 3), in NumPy."""
    square, J = np.einsum("mab,mab->m", F, F), np.linalg.det(F)
    m, l = 4 / 3 * lame_mu, lame_lambda + 5 / 6 * lame_mu  # noqa: E741
    a = 1 + lame_mu / l
    at_rest = l / 2 * (1 - a) ** 2 - m / 2 * np.log(4)
    return m / 2 * (square - 3) + l / 2 * (J - a) ** 2 - m / 2 * np.log(square + 1) - at_rest
