"""Continuum mechanics particle model (CMPM): springs along and across each edge (thesis chapter 4).

A face of the Voronoi graph separates two particles. The corners of the face move with the tetrahedra that
contain them. The normal of the deformed face splits the deformation of the edge into tension and
shear. Implicit Euler keeps the normal fixed (`bond_stiffness`), as in thesis 4.2.
"""

from __future__ import annotations

import numpy as np

from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.bonds import Bonds, Floats, columns
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import EdgeRings, TetMesh
from taichi_soft.meshing.voronoi import voronoi_graph


@ti.func
def direction_of(v):
    """Unit vector along `v`, or zero if `v` is zero."""
    return v / ti.max(ti.sqrt(v.dot(v)), 1e-30)


@ti.func
def bond_force(r, n, constants):
    """Force f_p = a/l (E (n.r - l) n + G m) on the first end of a bond [N], eq. 4.1 to 4.4; f_q = -f_p.

    m = r - (n.r) n is the component of r across n. It is not normalised, because its length at rest is zero.
    Args:
        r: second end minus first end [m].
        n: unit normal of the face between the ends, towards the second end; zero gives no force.
        constants: l [m], a E / l and a G / l [N/m] in x, y and z.
    """
    stretch = n.dot(r)
    return n * (constants.y * (stretch - constants.x)) + (r - n * stretch) * constants.z


@ti.func
def bond_damping(r, n, relative_velocity, tensile, shear):
    """Damping force on the first end of a bond [N], eq. 4.5.

    The force acts along n and, if the bond is sheared, along the shear direction m. The part along m also
    damps the rotation of sheared bodies.
    Args:
        r, n: see `bond_force`. r can also be the direction that the law compares with n.
        relative_velocity: velocity of the second end relative to the first [m/s].
        tensile, shear: b_n and b_m [N s/m].
    """
    m = shear_direction(r, n)
    return n * (tensile * n.dot(relative_velocity)) + m * (shear * m.dot(relative_velocity))


@ti.func
def shear_direction(r, n):
    """Unit vector along the component of r across n; zero if the component is round-off, below 1e-6 of r."""
    m = r - n * n.dot(r)
    return ti.select(m.dot(m) > 1e-12 * r.dot(r), direction_of(m), m * 0.0)


def moduli(rings: EdgeRings, material: Material) -> tuple[Floats, Floats, Floats]:
    """Return the mean E [Pa], G [Pa] and shear damping b_m [N s/m] around every edge, (k,) each."""
    count = len(rings.mesh.tets)
    shear = "lame_mu" if material.shear_modulus is None else "shear_modulus"
    damping = "damping" if material.shear_damping is None else "shear_damping"
    across = material.per_tet(damping, count)
    mean_damping = rings.sum(across[rings.tet]) / rings.mesh.edge_valence
    return (
        rings.mean(material.per_tet("young", count)),
        rings.mean(material.per_tet(shear, count)),
        mean_damping,
    )


def cmpm_bonds(mesh: TetMesh, material: Material) -> Bonds:
    """Return the bonds of a mesh, across the clipped faces of its Voronoi graph.

    Each ring row is a corner of a face in barycentric coordinates. The last row of a face repeats its first
    corner. Each particle has the mass of its Voronoi cell (section 4.1).
    Raises: MeshError if the mesh is not Delaunay.
    """
    graph = voronoi_graph(mesh)
    young, shear, damping = moduli(EdgeRings.of(mesh), material)
    per_length = graph.areas / mesh.edge_lengths
    ends = mesh.vertices[mesh.edges]
    normals = (ends[:, 1] - ends[:, 0]) / mesh.edge_lengths[:, None]
    is_bond = graph.areas > 0
    constants = columns(
        mesh.edge_lengths, young * per_length, shear * per_length, damping, count=len(mesh.edges)
    )
    density = material.per_tet("density", len(mesh.tets))
    return Bonds(
        np.where(is_bond[:, None], constants, 0.0),
        graph.corner_edge,
        mesh.tets[graph.corner_tet].astype(np.int64),
        graph.corner_weights,
        np.where(is_bond[:, None], normals, np.nan),
        graph.masses(density),
    )
