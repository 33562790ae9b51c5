"""Springs with additional forces that preserve the volume of tetrahedra (thesis chapter 5).

A tetrahedron that expands by dV also pulls the ends of each of its six edges together. The pull is the
pressure E nu dV / V0 times the total area a of the edge: eq. 5.5 with the opposite sign. With the printed
sign, an expanded tetrahedron pushes the ends apart, and its volume diverges. To get the printed forces, use
Poisson's ratio -nu, which does not affect the springs.
"""

from __future__ import annotations

from taichi_soft.core.errors import MeshError
from taichi_soft.core.math.tensors import cofactor, determinant
from taichi_soft.core.math.tetrahedron import shape
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.bonds import Bonds, columns, member_columns
from taichi_soft.elements.laws.springs import spring_bonds
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import EdgeRings, TetMesh


@ti.func
def expansion(x0, x1, x2, x3, inverse_volume6):
    """Expansion dV / V0 of a tetrahedron (eq. 5.4).

    V is the absolute volume, so a tetrahedron is also at rest as its mirror image. With the signed volume, an
    inverted tetrahedron would push the ends of its edges apart, invert further, and diverge.
    Args:
        inverse_volume6: 1 / (6 V0) [1/m^3].
    """
    return ti.abs(determinant(shape(x0, x1, x2, x3))) * inverse_volume6 - 1.0


@ti.func
def expansion_gradients(x0, x1, x2, x3, inverse_volume6):
    """Derivatives of V / V0 with respect to each of the four vertices, four vec3 [1/m]."""
    B = shape(x0, x1, x2, x3)
    C = cofactor(B)
    scale = inverse_volume6 * ti.select(determinant(B) < 0.0, -1.0, 1.0)
    g1, g2, g3 = C[0] * scale, C[1] * scale, C[2] * scale
    return -(g1 + g2 + g3), g1, g2, g3


def volume_spring_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Return the springs of eq. 5.2, with the area a of each edge. Each ring row is a tetrahedron."""
    if not isinstance(mesh, TetMesh) or not isinstance(material, Material):
        raise MeshError("law 'volume_springs' needs tetrahedra and a Material")
    rings = EdgeRings.of(mesh)
    young, poisson = (material.per_tet(name, len(mesh.tets)) for name in ("young", "poisson"))
    constants = spring_bonds(mesh, material).constants
    constants[:, 2] = rings.edge_areas
    return Bonds(
        constants,
        rings.edge,
        member_columns(rings.tet, count=len(rings.edge)),
        columns(count=len(rings.edge)),
        expansion_modulus=young * poisson,
    )
