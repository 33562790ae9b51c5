"""Measurements of one body: volume, momentum, energy, strain, stress."""

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
    """Measurements of a body. Each call computes its result in float64 from the body's float32 state."""

    def volumes(self) -> Floats:
        """Signed volume of each tetrahedron, (m,) [m^3]; negative for inverted tetrahedra."""
        return measures.tet_volumes(self)

    def volume(self) -> float:
        """Volume of the body [m^3]. Inverted tetrahedra contribute negative volumes."""
        return float(self.volumes().sum())

    def flipped_count(self) -> int:
        """Number of inverted tetrahedra."""
        return len(self.flipped_tets())

    def flipped_tets(self) -> NDArray[np.int64]:
        """Indices of the inverted tetrahedra, ascending."""
        return np.flatnonzero(self.volumes() < 0)

    def pose(self) -> Pose:
        """Rigid motion that best fits the rest shape to the current positions, weighted by mass.

        The fitted positions are `mesh.vertices @ pose.rotation.T + pose.position`. The rotation never mirrors
        the body, even for a flat or inverted body. For a straight rope, the rotation about its axis is
        minimal.
        """
        return measures.pose(self)

    def momentum(self) -> Floats:
        """Linear momentum, (3,) [kg m/s]."""
        return np.asarray(self.masses @ measures.velocities_of(self))

    def angular_momentum(self) -> Floats:
        """Angular momentum about the world's origin, (3,) [kg m^2/s].

        That of a rod contains the spin of its edges.
        """
        return measures.angular_momentum(self)

    def kinetic_energy(self) -> float:
        """Kinetic energy 1/2 sum m v^2 [J]. That of a rod contains the spin of its edges."""
        return measures.kinetic_energy(self)

    def gravitational_energy(self) -> float:
        """Gravitational energy - sum m g.x, zero at the origin [J]."""
        return measures.gravitational_energy(self)

    def elastic_energy(self) -> float:
        """Elastic energy [J] of springs, shells, rods, and the laws "st_venant_kirchhoff" and "neo_hookean".

        For other laws, the result is 1/2 sum V0 sigma : eps with the linear strain, which is only an
        indicator. The stress of these laws is not the derivative of this energy, so without damping the total
        energy can drift.
        """
        return measures.elastic_energy(self)

    def deformations(self) -> Floats:
        """Deformation gradient F = B A^-1 of each tetrahedron (thesis eq. 6.3), (m, 3, 3).

        For a body with plasticity, F is the elastic part, relative to the current rest shape. All strains and
        stresses are also relative to the current rest shape.
        """
        return measures.deformations(self)

    def strains(self) -> Floats:
        """Linear strain 1/2 (F F^T - I) of each tetrahedron (thesis eq. 6.7), (m, 3, 3)."""
        return measures.strains(self)

    def plastic_strains(self) -> Floats:
        """Equivalent (von Mises) plastic strain of each tetrahedron, (m,).

        Plastic strain is permanent, and is measured as logarithmic strain.
        """
        return measures.plastic_strains(self)

    def stresses(self) -> Floats:
        """Stress of each tetrahedron, (m, 3, 3) [Pa], in world axes; tension is positive.

        This is the Cauchy stress of the body's law, force per current area, without damping. Laws along edges
        define no stress; for such laws, the stress is computed by Hooke's law with the linear strain.
        Inverted tetrahedra have a finite stress: the stress of their mirror image, or with "neo_hookean" the
        stress at the negative volume.
        """
        return measures.tet_stresses(self)

    def force_across(self, point: ArrayLike, normal: ArrayLike) -> Floats:
        """Elastic force across a plane, (3,) [N].

        The part of the body on the side of `normal` exerts this force on the other part. The force is the sum
        of `stresses` times the areas in which the plane cuts the tetrahedra. In a body at rest, the force
        balances the load beyond the plane, to the accuracy with which the mesh resolves the stress.
        Args:
            point: point of the plane, (3,) [m].
            normal: normal of the plane, (3,), of any nonzero length.
        Raises: OptionError for an invalid point or normal; MeshError for a body without tetrahedra.
        """
        return measures.force_across(self, point, normal)

    def tet_stress(self) -> Floats:
        """Von Mises stress of each tetrahedron, computed from `stresses`, (m,) [Pa]."""
        return measures.tet_stress(self)

    def tet_strain(self) -> Floats:
        """Equivalent (von Mises) strain sqrt(2/3 e:e) of each tetrahedron, (m,).

        e is the deviator of `strains`. Under uniaxial tension at constant volume, the equivalent strain is
        the axial strain. A pure change of volume has the equivalent strain 0.
        """
        return measures.tet_strain(self)

    def vertex_stress(self) -> Floats:
        """Average of `tet_stress` over the tetrahedra around each vertex, weighted by volume, (n,) [Pa]."""
        return measures.vertex_means(self, self.tet_stress())

    def vertex_strain(self) -> Floats:
        """Average of `tet_strain` over the tetrahedra around each vertex, weighted by volume, (n,)."""
        return measures.vertex_means(self, self.tet_strain())
