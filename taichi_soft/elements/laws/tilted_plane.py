"""CMPM with a plane tilted by the particles around an edge (thesis section 4.4.3, not implemented there).

At rest, the plane is perpendicular to its edge. If a particle around the edge rises by an angle, it tilts the
plane by c times that angle. The axis of this tilt is perpendicular to the edge and to the particle's arm. c
depends on beta, the part of the full angle around the edge that the particle represents. Eq. 4.11 and 4.12
print b = 1/4 and c = b beta / (2 pi), which tilt the plane by only an eighth of a uniform shear. With c =
beta / pi and evenly spaced particles, the tilt equals the shear. Implicit Euler keeps the plane's normal
fixed (`bond_stiffness`).
"""

from __future__ import annotations

import numpy as np

from taichi_soft.core.math.elementary import atan2, cos_sin
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.bonds import Bonds, Floats, columns, member_columns
from taichi_soft.elements.laws.cmpm import moduli
from taichi_soft.elements.laws.cmpm2 import require_tets
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import EdgeRings, TetMesh

PRINTED = 1 / 8
"""Ratio of two values of c: (1/4) beta / (2 pi), which eq. 4.12 prints, and beta / pi, which the corrected
law uses."""


@ti.func
def tilt(axis, arm, height, rest_angle, weight):
    """Contribution of one particle to the tilt of the normal, as a vector across the edge.

    Args:
        axis: unit vector along the edge.
        arm: vector from the edge's first end to the particle [m].
        height: height of the plane above the edge's first end [m].
        rest_angle: angle of the particle above the plane at rest.
        weight: c, tilt of the plane per angle of the particle.
    """
    rise = axis.dot(arm)
    across = arm - axis * rise
    distance = ti.max(ti.sqrt(across.dot(across)), 1e-30)
    # The variable is needed: inside a vector expression, Taichi would call atan2 once for each component.
    angle = atan2(rise - height, distance)
    return across * (weight * (angle - rest_angle) / distance)


@ti.func
def tilted_normal(axis, rotation):
    """Return the unit vector `axis`, rotated away from `rotation` by the length of `rotation` [rad]."""
    angle = ti.sqrt(rotation.dot(rotation))
    cosine, sine = cos_sin(angle)
    return axis * cosine - rotation * ti.select(angle > 1e-6, sine / ti.max(angle, 1e-6), 1.0)


def tilt_rows(rings: EdgeRings) -> tuple[Floats, Floats]:
    """Return beta / pi and the angle above the plane at rest [rad] of each particle, (s,) each.

    The particles are the rows of `rings.neighbours`. beta is the part of the full angle around the edge that
    the particle represents.
    """
    mesh = rings.mesh
    edge, vertex = rings.neighbours
    ends = mesh.vertices[mesh.edges[edge]]
    axis = (ends[:, 1] - ends[:, 0]) / mesh.edge_lengths[edge][:, None]
    arm = mesh.vertices[vertex] - ends[:, 0]
    rise = np.einsum("sa,sa->s", axis, arm)
    across = arm - rise[:, None] * axis
    start, count = np.searchsorted(edge, edge), np.bincount(edge)[edge]
    height = np.add.reduceat(rise, np.unique(start))[edge] / count
    rest_angle = np.arctan2(rise - height, np.linalg.norm(across, axis=1))
    index = np.arange(len(edge)) - start
    after, before = (start + (index + step) % count for step in (1, -1))
    return (_angle_about(axis, across, across[after]) + _angle_about(axis, across[before], across)) / (
        2 * np.pi
    ), rest_angle


def _angle_about(axis: Floats, one: Floats, other: Floats) -> Floats:
    """Angle from `one` to `other` about `axis`, from 0 to 2 pi."""
    sine = np.einsum("sa,sa->s", axis, np.cross(one, other))
    angle = np.arctan2(sine, np.einsum("sa,sa->s", one, other))
    return np.where(angle < -1e-9, angle + 2 * np.pi, np.maximum(angle, 0.0))


def tilted_plane_bonds(mesh: TetMesh, material: Material, factor: float = 1.0) -> Bonds:
    """Return the bonds of a mesh. Each ring row has a particle, c times `factor`, and the angle at rest."""
    rings = require_tets(mesh, material, "tilted_plane")
    edge, vertex = rings.neighbours
    fraction, rest_angle = tilt_rows(rings)
    young, shear, damping = moduli(rings, material)
    length = mesh.edge_lengths
    per_length = rings.edge_areas / length
    ends = mesh.vertices[mesh.edges]
    return Bonds(
        columns(length, young * per_length, shear * per_length, damping, count=len(mesh.edges)),
        edge,
        member_columns(vertex, count=len(edge)),
        columns(factor * fraction, rest_angle, count=len(edge)),
        (ends[:, 1] - ends[:, 0]) / length[:, None],
    )
