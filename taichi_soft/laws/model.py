"""Force model of one tetrahedron: which law, which strain, what happens to flips, which damping.

A model holds choices, never numbers, so that one compiled kernel serves every material.
"""

from dataclasses import dataclass
from typing import Any

from taichi_soft.laws import strain as strains
from taichi_soft.laws.hooke import hooke_stress
from taichi_soft.laws.recovery import recovering_stress
from taichi_soft.math.tensors import determinant, product
from taichi_soft.math.tetrahedron import shape
from taichi_soft.runtime import ti
from taichi_soft.types import DampingModel, Flips, Strain


@dataclass(frozen=True)
class Law:
    """One way to turn the stress of a tetrahedron into forces on its vertices."""

    name: str
    section: str  # of the thesis
    summary: str
    forces: Any  # ti.func (shape columns, stress columns) -> four vec3 [N]


@dataclass(frozen=True)
class ElementModel:
    """The choices that shape one body's force kernel."""

    law: Law
    strain: Strain = Strain.LINEAR
    flips: Flips = Flips.TOLERANT
    damping_model: DampingModel = DampingModel.EDGE

    @property
    def repairs_flips(self) -> bool:
        """True where a flipped tetrahedron takes another path than an upright one."""
        return self.flips is Flips.RECOVER


@ti.func
def upright_forces(model: ti.template(), x0, x1, x2, x3, rest_inverse, lame_lambda, lame_mu):
    """Elastic forces on four vertices [N], and six times the signed volume [m^3].

    Valid for every pose unless `model.repairs_flips`: then only where the volume is not negative.
    Args:
        x0, x1, x2, x3: deformed vertices, vec3 [m].
        rest_inverse: A^-1 of thesis eq. 6.1, as columns [1/m].
    """
    B = shape(x0, x1, x2, x3)
    F = product(B, rest_inverse)
    strain = strains.linear_strain(F) if ti.static(model.strain == Strain.LINEAR) else strains.exact_strain(F)
    stress = hooke_stress(strain, lame_lambda, lame_mu)
    f0, f1, f2, f3 = model.law.forces(B, stress)
    volume6 = determinant(B)
    if ti.static(model.flips == Flips.TOLERANT):
        # The mirrored shape is at rest too: take the area vectors as a right-handed tetrahedron would.
        mirror = ti.select(volume6 < 0.0, -1.0, 1.0)
        f0, f1, f2, f3 = f0 * mirror, f1 * mirror, f2 * mirror, f3 * mirror
    return f0, f1, f2, f3, volume6


@ti.func
def flipped_forces(model: ti.template(), x0, x1, x2, x3, rest_inverse, lame_lambda, lame_mu):
    """Forces of `flips="recover"` on a tetrahedron whose volume is negative [N]."""
    B = shape(x0, x1, x2, x3)
    F = product(B, rest_inverse)
    return model.law.forces(B, recovering_stress(model.strain, F, lame_lambda, lame_mu))
