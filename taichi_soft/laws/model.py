"""Force model of one tetrahedron: which law, which strain, what happens to flips, which damping.

A model holds choices, never numbers, so that one compiled kernel serves every material.
"""

from dataclasses import dataclass

from taichi_soft.laws import strain as strains
from taichi_soft.laws.bonds import Ring
from taichi_soft.laws.energy import energy_forces
from taichi_soft.laws.hooke import hooke_stress
from taichi_soft.laws.law import BondLaw, EnergyLaw, Law
from taichi_soft.laws.recovery import recovering_stress
from taichi_soft.math.tensors import determinant, product
from taichi_soft.math.tetrahedron import shape
from taichi_soft.runtime import ti
from taichi_soft.types import DampingModel, Flips, Strain


@dataclass(frozen=True)
class ElementModel:
    """The choices that shape one body's force kernel."""

    law: Law
    strain: Strain | None  # None where the law has no strain to choose
    flips: Flips | None  # None where the law does not look at tetrahedra
    damping_model: DampingModel

    @property
    def has_energy(self) -> bool:
        """True where the forces are the derivative of an energy."""
        return isinstance(self.law, EnergyLaw)

    @property
    def has_bonds(self) -> bool:
        """True where forces act between the ends of edges, False where on the corners of tetrahedra."""
        return isinstance(self.law, BondLaw)

    @property
    def reads_expansion(self) -> bool:
        """True where edges look at how their tetrahedra have grown."""
        return isinstance(self.law, BondLaw) and self.law.ring is Ring.EXPANSION

    @property
    def has_simple_edges(self) -> bool:
        """True where an edge asks for its two ends only, and for what tetrahedra pull it with."""
        return not isinstance(self.law, BondLaw) or self.law.ring in (Ring.NONE, Ring.EXPANSION)

    @property
    def repairs_flips(self) -> bool:
        """True where a flipped tetrahedron takes another path than an upright one."""
        return self.flips is Flips.RECOVER and not self.has_energy

    @property
    def mirrors_forces(self) -> bool:
        """True where a flipped tetrahedron takes the forces of its mirror image."""
        return self.flips is Flips.TOLERANT and not self.has_energy


@ti.func
def hooke_stress_of(model: ti.template(), F, lame_lambda, lame_mu):
    """Hooke's stress of the strain that the model names [Pa], as columns."""
    strain = strains.linear_strain(F) if ti.static(model.strain == Strain.LINEAR) else strains.exact_strain(F)
    return hooke_stress(strain, lame_lambda, lame_mu)


@ti.func
def elastic_forces(model: ti.template(), B, F, rest_inverse, lame_lambda, lame_mu):
    """Forces on four vertices [N] by the model's law."""
    if ti.static(model.has_energy):
        return energy_forces(model.law.piola(F, lame_lambda, lame_mu), rest_inverse)
    else:
        return model.law.forces(B, hooke_stress_of(model, F, lame_lambda, lame_mu))


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
    f0, f1, f2, f3 = elastic_forces(model, B, F, rest_inverse, lame_lambda, lame_mu)
    volume6 = determinant(B)
    if ti.static(model.mirrors_forces):
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
