"""Mass-spring model (thesis section 3.4)."""

from __future__ import annotations

from taichi_soft.core.errors import MeshError
from taichi_soft.core.runtime import ti
from taichi_soft.elements.laws.bonds import Bonds, columns
from taichi_soft.elements.materials import Material, SpringMaterial
from taichi_soft.meshing import BodyMesh, EdgeRings, TetMesh

TINY = 1e-30
"""Number that is added to squared lengths to avoid a division by zero [m^2]. It is negligible compared with
any squared length. Adding it is faster than taking a maximum."""


@ti.func
def spring_tension(r, constants):
    """Pull of a spring on its ends [N], eq. 3.8.

    Args:
        r: second end minus first end [m].
        constants: length at rest [m] and stiffness k [N/m] in x and y.
    """
    return constants.y * (ti.sqrt(r.dot(r) + TINY) - constants.x)


@ti.func
def along(r, tension):
    """Force on the first end of an edge [N] if the ends pull each other with `tension` [N].

    The force is zero if both ends coincide, because the edge then has no direction.
    """
    return r * (tension / ti.max(ti.sqrt(r.dot(r)), 1e-15))


@ti.func
def damped_pull(r, relative_velocity, tension, damping):
    """Sum of `along` and `edge_damping_force` [N]. The only division does not depend on the square root."""
    square = r.dot(r) + TINY
    inverse = 1.0 / square
    return r * (inverse * (tension * ti.sqrt(square) + damping * r.dot(relative_velocity)))


def spring_bonds(mesh: BodyMesh, material: Material | SpringMaterial) -> Bonds:
    """Return the springs on the edges of a mesh.

    A `SpringMaterial` contains the constants of the springs. For a `Material`, the stiffness is k = E a / l
    (eq. 5.1). a is the total area of an edge's barycentric subfaces (4.4.1), and E is the mean of Young's
    modulus over these subfaces.
    """
    count = len(mesh.edges)
    if isinstance(material, SpringMaterial):
        length = material.per_edge("rest_length", count, mesh.edge_lengths)
        return Bonds(columns(length, material.per_edge("stiffness", count), count=count))
    if not isinstance(mesh, TetMesh):
        raise MeshError("a ParticleMesh has no volume for a Material: pass a SpringMaterial")
    rings = EdgeRings.of(mesh)
    young = rings.mean(material.per_tet("young", len(mesh.tets)))
    return Bonds(columns(mesh.edge_lengths, young * rings.edge_areas / mesh.edge_lengths, count=count))
