"""Force model of one tetrahedron: law, strain, treatment of flips, and damping.

A model contains choices but no numbers, so one compiled kernel works for every material.
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
from taichi_soft.elements.laws.law import BondLaw, EnergyLaw, Law, RodLaw, ShellLaw
from taichi_soft.elements.laws.recovery import recovering_piola

MIN_VOLUME = 1 / 1024
"""Lower limit of the relative volume V / V0 as a divisor in the conversion of force to stress. It keeps the
stress of a flat tetrahedron finite."""


@dataclass(frozen=True)
class ElementModel:
    """Choices that determine the compiled force kernel of one body."""

    law: Law
    strain: Strain | None  # None if the law supports only one strain
    flips: Flips | None  # None for laws along edges, shells and rods
    damping_model: DampingModel
    is_anisotropic: bool = False  # True if the material has 21 constants instead of 2

    @property
    def has_energy(self) -> bool:
        """True if the forces are the derivative of an energy."""
        return isinstance(self.law, EnergyLaw)

    @property
    def has_bonds(self) -> bool:
        """True if elastic forces act along edges."""
        return isinstance(self.law, BondLaw)

    @property
    def is_shell(self) -> bool:
        """True if elastic forces act on the corners of triangles and of their neighbours."""
        return isinstance(self.law, ShellLaw)

    @property
    def is_rod(self) -> bool:
        """True if elastic forces act on edges and joints, whose torsion has its own state."""
        return isinstance(self.law, RodLaw)

    @property
    def has_tets(self) -> bool:
        """True if elastic forces act on the corners of tetrahedra."""
        return not (self.has_bonds or self.is_shell or self.is_rod)

    @property
    def reads_expansion(self) -> bool:
        """True if the force of an edge depends on the expansion of its tetrahedra."""
        return isinstance(self.law, BondLaw) and self.law.ring is Ring.EXPANSION

    @property
    def has_simple_edges(self) -> bool:
        """True if the force of an edge depends only on its two ends and the pull of its tetrahedra."""
        return not isinstance(self.law, BondLaw) or self.law.ring in (Ring.NONE, Ring.EXPANSION)

    @property
    def repairs_flips(self) -> bool:
        """True if a flipped tetrahedron needs `flipped_forces`."""
        return self.flips is Flips.RECOVER and not self.has_energy

    @property
    def mirrors_forces(self) -> bool:
        """True if a flipped tetrahedron has the forces of its mirror image."""
        return self.flips is Flips.TOLERANT and not self.has_energy


@ti.func
def hooke_stress_of(model: ti.template(), F, lame_lambda, lame_mu):
    """Hooke's stress for the model's strain, or for linear strain if the model has none [Pa], as columns."""
    strain = strains.exact_strain(F) if ti.static(model.strain == Strain.EXACT) else strains.linear_strain(F)
    return hooke_stress(strain, lame_lambda, lame_mu)


@ti.func
def piola_of(model: ti.template(), F, elasticity):
    """Derivative of the energy density with respect to F [Pa], as columns, for a model with an energy."""
    if ti.static(model.is_anisotropic):
        return product(F, green_stress(F, elasticity))
    else:
        return model.law.piola(F, elasticity[0], elasticity[1])


@ti.func
def cauchy_stress(model: ti.template(), F, elasticity):
    """Cauchy stress of a deformation by the model's law, force per deformed area [Pa], as columns.

    The stress is in world axes. Laws along edges compute no stress; the result for them is Hooke's stress of
    linear strain. An inverted tetrahedron has the stress of its mirror image. But if an energy restores the
    tetrahedron, the forces are divided by its negative volume, because compression would otherwise count as
    tension.
    Args:
        elasticity: see `elastic_forces`.
    """
    if ti.static(model.has_energy):
        J = determinant(F)
        volume = ti.max(ti.abs(J), MIN_VOLUME)
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
    """Elastic forces on the four vertices of a tetrahedron [N] by the model's law.

    Args:
        elasticity: lambda and mu [Pa], or the stiffness for `anisotropic_stress`.
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

    If `model.repairs_flips`, the forces are valid only if the volume is not negative.
    Args:
        x0, x1, x2, x3: deformed vertices, vec3 [m].
        rest_inverse: A^-1 of thesis eq. 6.1, as columns [1/m].
        elasticity: see `elastic_forces`.
    """
    B = shape(x0, x1, x2, x3)
    F = product(B, rest_inverse)
    f0, f1, f2, f3 = elastic_forces(model, B, F, rest_inverse, elasticity)
    volume6 = determinant(B)
    if ti.static(model.mirrors_forces):
        # The area vectors of a right-handed tetrahedron make the mirrored shape a rest shape too.
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
