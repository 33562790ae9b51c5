"""Stress of isotropic laws in principal axes, and derivatives of this stress, for the derivatives of forces.

With F = U diag(s) V^T, every isotropic law has P = U diag(p(s)) V^T (Stomakhin et al. 2012, Energetically
consistent invertible elasticity). In the laws of thesis chapter 6, p_a is sigma_a times the product of the
other two stretches, because forces are stress times deformed area.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Flips, Strain
from taichi_soft.elements.laws.recovery import recovering_principal


@ti.func
def cofactors(s):
    """Return the product of the other two stretches for each axis, vec3.

    Also return the derivatives of these products with respect to the stretches, as columns.
    """
    others = ti.Vector([s.y * s.z, s.x * s.z, s.x * s.y])
    zero = s.x * 0.0
    return others, (ti.Vector([zero, s.z, s.y]), ti.Vector([s.z, zero, s.x]), ti.Vector([s.y, s.x, zero]))


@ti.func
def axis_of(s, c: ti.template()):
    """Unit vector along axis `c`, in the precision of `s`."""
    v = s * 0.0
    v[c] += 1.0
    return v


@ti.func
def hooke_principal(model: ti.template(), s, lame_lambda, lame_mu):
    """Return the principal stress p(s) [Pa], and dp/ds as columns, for a law of chapter 6.

    Args:
        model: model with the options for strain and flips.
        s: stretches, as `signed_svd` orders them.
    """
    t = s
    mirror = s.x * 0.0 + 1.0
    if ti.static(model.flips == Flips.TOLERANT):
        mirror = ti.select(s.z < 0.0, -mirror, mirror)
        t.z = ti.abs(s.z)
    strain, rate = 0.5 * (t * t - 1.0), t
    if ti.static(model.strain == Strain.EXACT):
        strain, rate = ti.abs(t) - 1.0, ti.select(t < 0.0, -1.0, 1.0) + t * 0.0
    stress = 2.0 * lame_mu * strain + lame_lambda * strain.sum()
    others, changes = cofactors(t)
    p = stress * others
    signs = s * 0.0 + 1.0
    signs.z = mirror
    c0 = (lame_lambda + 2.0 * lame_mu * axis_of(s, 0)) * rate.x * others + stress * changes[0]
    c1 = (lame_lambda + 2.0 * lame_mu * axis_of(s, 1)) * rate.y * others + stress * changes[1]
    c2 = (lame_lambda + 2.0 * lame_mu * axis_of(s, 2)) * rate.z * others + stress * changes[2]
    p, c0, c1, c2 = p * signs, c0 * signs, c1 * signs, c2 * signs * mirror
    if ti.static(model.flips == Flips.RECOVER):
        if s.z < 0.0:
            p, rate = recovering_principal(s, lame_lambda + 2.0 * lame_mu)
            c0, c1, c2 = axis_of(rate, 0) * rate.x, axis_of(rate, 1) * rate.y, axis_of(rate, 2) * rate.z
    return p, (c0, c1, c2)
