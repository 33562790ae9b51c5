"""Force model of one tetrahedron: which law, which strain, what happens to flips, which damping.

A model holds choices, never numbers, so that one compiled kernel serves every material.
"""

from dataclasses import dataclass

from taichi_soft.core.math.tensors import determinant, product, transposed
from taichi_soft.core.math.tetrahedron import shape
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import DampingModel, Flips, Strain
from taichi_soft.elements.laws import strain as strains
from taichi_soft.elements.laws.anisotropy import green_stress, turned_stress, wave_modulus
from taichi_soft.elements.laws.bonds import Ring
from taichi_soft.elements.laws.energy import energy_forces
from taichi_soft.elements.laws.hooke import hooke_stress
from taichi_soft.elements.laws.law import BondLaw, EnergyLaw, Law
from taichi_soft.elements.laws.recovery import recovering_piola

LEAST_VOLUME = 1 / 1024
"""Part of its volume at rest that a flatter tetrahedron is taken to have, where stress is force by area."""


@dataclass(frozen=True)
class ElementModel:
    """The choices that shape one body's force kernel."""

    law: Law
    strain: Strain | None  # None where the law has no strain to choose
    flips: Flips | None  # None where the law does not look at tetrahedra
    damping_model: DampingModel
    is_anisotropic: bool = False  # its material has 21 constants instead of 2

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
    """Hooke's stress of the strain that the model names, or linear strain [Pa], as columns."""
    strain = strains.exact_strain(F) if ti.static(model.strain == Strain.EXACT) else strains.linear_strain(F)
    return hooke_stress(strain, lame_lambda, lame_mu)


@ti.func
def piola_of(model: ti.template(), F, elasticity):
    """Derivative of the energy that the model's law has by F [Pa], as columns."""
    if ti.static(model.is_anisotropic):
        return product(F, green_stress(F, elasticity))
    else:
        return model.law.piola(F, elasticity[0], elasticity[1])


@ti.func
def cauchy_stress(model: ti.template(), F, elasticity):
    """Force by deformed area that the model's law answers a deformation with [Pa], as columns.

    In the axes of the world. Laws along edges have none: theirs is Hooke's, of the linear strain. What is
    inside out has the stress of its mirror image; under an energy that turns it round again that of the
    negative volume, or what was crushed would count as pulled.
    Args:
        elasticity: as in `elastic_forces`.
    """
    if ti.static(model.has_energy):
        J = determinant(F)
        volume = ti.max(ti.abs(J), LEAST_VOLUME)
        if ti.static(model.flips == Flips.RECOVER):
            volume = ti.select(J < 0.0, -volume, volume)
        stress = product(piola_of(model, F, elasticity), transposed(F))
        return stress[0] / volume, stress[1] / volume, stress[2] / volume
    elif ti.static(model.is_anisotropic):
        return turned_stress(model, F, elasticity)
    else:
        return hooke_stress_of(model, F, elasticity[0], elasticity[1])


@ti.func
def elastic_forces(model: ti.template(), B, F, rest_inverse, elasticity):
    """Forces on four vertices [N] by the model's law.

    Args:
        elasticity: lambda and mu [Pa], or a stiffness as `anisotropic_stress` takes it.
    """
    if ti.static(model.has_energy):
        return energy_forces(piola_of(model, F, elasticity), rest_inverse)
    elif ti.static(model.is_anisotropic):
        return model.law.forces(B, turned_stress(model, F, elasticity))
    else:
        return model.law.forces(B, hooke_stress_of(model, F, elasticity[0], elasticity[1]))


@ti.func
def upright_forces(model: ti.template(), x0, x1, x2, x3, rest_inverse, elasticity):
    """Elastic forces on four vertices [N], and six times the signed volume [m^3].

    Valid for every pose unless `model.repairs_flips`: then only where the volume is not negative.
    Args:
        x0, x1, x2, x3: deformed vertices, vec3 [m].
        rest_inverse: A^-1 of thesis eq. 6.1, as columns [1/m].
        elasticity: as in `elastic_forces`.
    """
    B = shape(x0, x1, x2, x3)
    F = product(B, rest_inverse)
    f0, f1, f2, f3 = elastic_forces(model, B, F, rest_inverse, elasticity)
    volume6 = determinant(B)
    if ti.static(model.mirrors_forces):
        # The mirrored shape is at rest too: take the area vectors as a right-handed tetrahedron would.
        mirror = ti.select(volume6 < 0.0, -1.0, 1.0)
        f0, f1, f2, f3 = f0 * mirror, f1 * mirror, f2 * mirror, f3 * mirror
    return f0, f1, f2, f3, volume6


@ti.func
def flipped_forces(model: ti.template(), x0, x1, x2, x3, rest_inverse, elasticity):
    """Forces of `flips="recover"` on a tetrahedron whose volume is negative [N]."""
    F = product(shape(x0, x1, x2, x3), rest_inverse)
    if ti.static(model.is_anisotropic):
        return energy_forces(recovering_piola(F, wave_modulus(elasticity)), rest_inverse)
    else:
        return energy_forces(recovering_piola(F, elasticity[0] + 2.0 * elasticity[1]), rest_inverse)
