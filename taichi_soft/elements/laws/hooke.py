"""Hooke's law for an isotropic material (thesis eq. 2.36, with tensor shear strain)."""

from taichi_soft.core.math.tensors import scaled_plus_identity, trace
from taichi_soft.core.runtime import ti


@ti.func
def hooke_stress(strain, lame_lambda, lame_mu):
    """Stress sigma = lambda tr(eps) I + 2 mu eps [Pa], as columns."""
    return scaled_plus_identity(strain, 2.0 * lame_mu, lame_lambda * trace(strain))
