"""What is measured of one body: volume, momentum, energy, strain, stress."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies import measures
from taichi_soft.bodies.pose import Pose
from taichi_soft.bodies.soft_body import SoftBody

Floats32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class BodyMeasures(SoftBody):
    """What of a body is computed, in float64 from its float32 state, at the time of the call."""

    def volumes(self) -> Floats:
        """Signed volume of each tetrahedron, (m,) [m^3]: negative where it is flipped."""
        return measures.tet_volumes(self)

    def volume(self) -> float:
        """Volume of the body, flipped tetrahedra counted negative [m^3]."""
        return float(self.volumes().sum())

    def flipped_count(self) -> int:
        """Number of tetrahedra that are inside out."""
        return len(self.flipped_tets())

    def flipped_tets(self) -> NDArray[np.int64]:
        """Tetrahedra that are inside out, ascending."""
        return np.flatnonzero(self.volumes() < 0)

    def pose(self) -> Pose:
        """The rigid motion of the rest shape that comes nearest to the body, weighted by mass.

        `mesh.vertices @ pose.rotation.T + pose.position` fits the positions best. The rotation never mirrors,
        also where the body is flat or inside out; about the axis of a straight rope it turns as little as
        possible.
        """
        return measures.pose(self)

    def momentum(self) -> Floats:
        """Linear momentum, (3,) [kg m/s]."""
        return np.asarray(self.masses @ measures.velocities_of(self))

    def angular_momentum(self) -> Floats:
        """About the world's origin, (3,) [kg m^2/s]."""
        return measures.angular_momentum(self)

    def kinetic_energy(self) -> float:
        """1/2 sum m v^2 [J]."""
        return measures.kinetic_energy(self)

    def gravitational_energy(self) -> float:
        """- sum m g.x, zero at the origin [J]."""
        return measures.gravitational_energy(self)

    def elastic_energy(self) -> float:
        """Of springs and the laws "st_venant_kirchhoff" and "neo_hookean": what deforming the body took [J].

        Of the other laws 1/2 sum V0 sigma : eps of the linear strain: an indicator, not a conserved
        energy. Their stress is not the derivative of any energy (except of another one at poisson = 1/4), so
        the total may drift without damping.
        """
        return measures.elastic_energy(self)

    def deformations(self) -> Floats:
        """Deformation gradient F = B A^-1 of each tetrahedron (thesis eq. 6.3), (m, 3, 3).

        Of a body with plasticity the elastic one, against the rest shape as it is now. So are all strains and
        stresses.
        """
        return measures.deformations(self)

    def strains(self) -> Floats:
        """Linear strain 1/2 (F F^T - I) of each tetrahedron (thesis eq. 6.7), (m, 3, 3)."""
        return measures.strains(self)

    def plastic_strains(self) -> Floats:
        """Equivalent (von Mises) logarithmic strain that each tetrahedron has for good, (m,)."""
        return measures.plastic_strains(self)

    def stresses(self) -> Floats:
        """Stress of each tetrahedron, (m, 3, 3) [Pa], in the axes of the world; above 0 is tension.

        The Cauchy stress: force by area as it is now, of the body's own law, without damping. Laws along
        edges know none: theirs is by Hooke's law and linear strain. Inside out it is finite: that of the
        mirror image, by law "neo_hookean" that of a negative volume.
        """
        return measures.tet_stresses(self)

    def force_across(self, point: ArrayLike, normal: ArrayLike) -> Floats:
        """Elastic force across a plane, (3,) [N].

        The part beyond it, where `normal` points, pulls the other part with this: `stresses` times the areas
        in which the plane cuts the tetrahedra, as they lie now. In a body at rest it carries what hangs on
        it, as exactly as the mesh resolves the stress.
        Args:
            point: of the plane, (3,) [m].
            normal: of the plane, (3,), of any length but zero.
        Raises: OptionError for a point or normal that is none; MeshError for a body without tetrahedra.
        """
        return measures.force_across(self, point, normal)

    def tet_stress(self) -> Floats:
        """Von Mises stress of each tetrahedron, (m,) [Pa], of `stresses`."""
        return measures.tet_stress(self)

    def tet_strain(self) -> Floats:
        """Equivalent (von Mises) strain sqrt(2/3 e:e) of each tetrahedron, (m,), e the deviator of `strains`.

        The strain of a pull that keeps the volume; a change of volume alone has none.
        """
        return measures.tet_strain(self)

    def vertex_stress(self) -> Floats:
        """`tet_stress` averaged by volume over the tetrahedra round each vertex, (n,) [Pa]."""
        return measures.vertex_means(self, self.tet_stress())

    def vertex_strain(self) -> Floats:
        """`tet_strain` averaged by volume over the tetrahedra round each vertex, (n,)."""
        return measures.vertex_means(self, self.tet_strain())
