"""List of all options and features that exclude each other. `docs/limits.md` has the same table."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Conflict:
    """A pair of an option and a feature that exclude each other."""

    option: str
    features: str
    reason: str
    solution: str

    def message(self, option: str = "", feature: str = "") -> str:
        """Return the error message of this conflict.

        Args:
            option, feature: more specific names for the message; "" for the names of the pair.
        """
        said = f"{option or self.option} does not support {feature or self.features}"
        return f"{said}, because {self.reason}: {self.solution}"


FLAT = Conflict(
    "schedule 'flat'",
    "colliders beside the floor, hulls, soft contact, sleep, cuts, levels of detail, shells, rods, forces, "
    "wind, linear damping, force fields, grabs, joints, motors, two-way attachments, events of contact",
    "its loops run over the particles of all bodies at once",
    "use schedule='per_body', and another integrator than 'explicit_euler'",
)
FLAT_SOLVES = Conflict(
    "schedule 'flat'",
    "implicit_euler",
    "one thread solves a whole body",
    "use schedule='per_body' or 'auto'",
)
ONLY_FLAT = Conflict(
    "integrator 'explicit_euler'",
    "schedule 'per_body'",
    "it is kept for the thesis's comparisons, without colliders",
    "use schedule='flat' or 'auto', or integrator='leapfrog'",
)
SOLVED = Conflict(
    "integrator 'implicit_euler'",
    "hulls, shells, rods",
    "its linear system has blocks for vertices and edges only, not for points of a hull or for bending",
    "use integrator='leapfrog', an asset without hull, or springs instead of a shell or a rod",
)
HULL_CUTS = Conflict(
    "a hull",
    "spare_vertices and tearing",
    "its points are bound to tetrahedra that a cut replaces",
    "leave out hull, or spare_vertices and tearing",
)
HULL_ITSELF = Conflict(
    "a hull",
    "self-contact",
    "its points lie next to its own triangles",
    "leave out hull or contact.itself",
)
EDGE_LAW_CUTS = Conflict(
    "a law along edges, a shell or a rod",
    "spare_vertices and tearing",
    "a cut divides tetrahedra",
    "use a law on tetrahedra, such as 'virial'",
)
EDGE_LAW_FLOW = Conflict(
    "a law along edges, a shell or a rod",
    "plasticity",
    "it computes no stress of tetrahedra",
    "use a law on tetrahedra, such as 'virial'",
)
EDGE_LAW_CAGE = Conflict(
    "a law along edges",
    "cages",
    "cells at the surface are partly filled, and edges have no volume",
    "use a law on tetrahedra, such as 'virial'",
)
ANISOTROPIC_LAW = Conflict(
    "an AnisotropicMaterial",
    "most laws",
    "they take two constants of elasticity",
    "use 'virial', 'face' or 'st_venant_kirchhoff', or a Material",
)
ANISOTROPIC_FAILURE = Conflict(
    "an AnisotropicMaterial",
    "plasticity and tearing",
    "its strength would depend on direction",
    "leave them out, or use a Material",
)
NO_TETRAHEDRA = Conflict(
    "a ParticleMesh, a ShellMesh or a RodMesh",
    "skins, hulls, and laws on tetrahedra",
    "it has no tetrahedra",
    "use a TetMesh, or law='springs' with a SpringMaterial",
)

CONFLICTS = (
    FLAT,
    FLAT_SOLVES,
    ONLY_FLAT,
    SOLVED,
    HULL_CUTS,
    HULL_ITSELF,
    EDGE_LAW_CUTS,
    EDGE_LAW_FLOW,
    EDGE_LAW_CAGE,
    ANISOTROPIC_LAW,
    ANISOTROPIC_FAILURE,
    NO_TETRAHEDRA,
)
