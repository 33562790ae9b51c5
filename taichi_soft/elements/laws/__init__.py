"""Force laws by name. A new law needs a file, an entry here, and its name in `core.types`."""

from dataclasses import replace
from functools import partial

from taichi_soft.core.checks import choose_one_of
from taichi_soft.core.conflicts import ANISOTROPIC_LAW, NO_TETRAHEDRA
from taichi_soft.core.errors import MaterialError, MeshError, OptionError
from taichi_soft.core.types import (
    ChoiceT,
    DampingModel,
    DampingModelName,
    Flips,
    FlipsName,
    LawName,
    Strain,
    StrainName,
)
from taichi_soft.elements.laws.best_fitting_plane import best_fitting_plane_bonds
from taichi_soft.elements.laws.bonds import Ring
from taichi_soft.elements.laws.cmpm import cmpm_bonds
from taichi_soft.elements.laws.cmpm2 import cmpm2_bonds
from taichi_soft.elements.laws.face import face_forces
from taichi_soft.elements.laws.force_model import ElementModel
from taichi_soft.elements.laws.law import SOLID, BondLaw, EnergyLaw, Law, RodLaw, ShellLaw, StressLaw
from taichi_soft.elements.laws.neo_hookean import neo_hookean_energy, neo_hookean_piola, neo_hookean_principal
from taichi_soft.elements.laws.rod import rods_of
from taichi_soft.elements.laws.shell import shells_of
from taichi_soft.elements.laws.split_ring_plane import split_ring_plane_bonds
from taichi_soft.elements.laws.springs import spring_bonds
from taichi_soft.elements.laws.st_venant_kirchhoff import (
    st_venant_kirchhoff_energy,
    st_venant_kirchhoff_piola,
    st_venant_kirchhoff_principal,
)
from taichi_soft.elements.laws.tilted_plane import PRINTED, tilted_plane_bonds
from taichi_soft.elements.laws.virial import virial_forces
from taichi_soft.elements.laws.volume_springs import volume_spring_bonds
from taichi_soft.elements.materials import (
    CONSTANTS,
    AnisotropicMaterial,
    AnyMaterial,
    RigidMaterial,
    RodMaterial,
    ShellMaterial,
    SpringMaterial,
)
from taichi_soft.meshing import BodyMesh, ParticleMesh, RodMesh, ShellMesh, TetMesh
from taichi_soft.meshing.advice import fill_hint
from taichi_soft.meshing.rigid_mesh import RigidMesh

__all__ = [
    "LAWS",
    "ROD",
    "SHELL",
    "BondLaw",
    "ElementModel",
    "EnergyLaw",
    "Law",
    "RodLaw",
    "ShellLaw",
    "StressLaw",
    "default_law",
    "element_model",
    "fit_model",
]

LAWS: dict[LawName, Law] = {
    law.name: law
    for law in (
        StressLaw("virial", "thesis 6.3", "Hooke's stress to forces by the virial theorem", virial_forces),
        StressLaw("face", "thesis 6.2", "Hooke's stress to forces by the four faces", face_forces),
        EnergyLaw(
            "st_venant_kirchhoff",
            "suggested in thesis 6.4",
            "Hooke's law as the derivative of an energy: no drift without damping",
            st_venant_kirchhoff_piola,
            st_venant_kirchhoff_principal,
            st_venant_kirchhoff_energy,
            (Strain.LINEAR,),
            (Flips.TOLERANT,),
            takes_anisotropy=True,
        ),
        EnergyLaw(
            "neo_hookean",
            "Smith, de Goes and Kim 2018",
            "rubber that conserves energy and recovers from every flip",
            neo_hookean_piola,
            neo_hookean_principal,
            neo_hookean_energy,
            (),
            (Flips.RECOVER,),
        ),
        BondLaw(
            "springs",
            "thesis 3.4",
            "a spring on every edge",
            Ring.NONE,
            spring_bonds,
            ("young", "density", "damping; or stiffness", "damping", "rest_length"),
            keeps_energy=True,
        ),
        BondLaw(
            "volume_springs",
            "thesis 5.1",
            "springs, and tetrahedra that pull their edges together as they expand",
            Ring.EXPANSION,
            volume_spring_bonds,
            SOLID,
        ),
        BondLaw(
            "cmpm",
            "thesis 4.1",
            "a spring along and one across each edge, separated by its Voronoi face",
            Ring.VORONOI,
            cmpm_bonds,
        ),
        BondLaw(
            "cmpm2",
            "thesis 4.4.1",
            "the same with barycentric subfaces instead of the Voronoi graph",
            Ring.SUBFACES,
            cmpm2_bonds,
        ),
        BondLaw(
            "best_fitting_plane",
            "thesis 4.4.2",
            "the same with a plane fitted to the particles around the edge",
            Ring.PLANE,
            best_fitting_plane_bonds,
        ),
        BondLaw(
            "split_ring_plane",
            "thesis 4.4.2",
            "the same with the cheap normal of that plane: a ring of particles split into halves twice",
            Ring.HALVES,
            split_ring_plane_bonds,
        ),
        BondLaw(
            "tilted_plane",
            "thesis 4.4.3",
            "the same with a plane tilted by the particles around the edge",
            Ring.TILT,
            tilted_plane_bonds,
        ),
        BondLaw(
            "tilted_plane_printed",
            "thesis eq. 4.12",
            "as printed, which tilts the plane by an eighth of the shear",
            Ring.TILT,
            partial(tilted_plane_bonds, factor=PRINTED),
        ),
    )
}


SHELL = ShellLaw(
    "shell",
    "Onate and Zarate 2000, Bergou et al. 2006",
    "a membrane of St. Venant-Kirchhoff's law and a plate, on triangles",
    shells_of,
)
"""The law of a `ShellMaterial`. It is not in `LAWS`, because there is no other law for shells, and no other
material for this law."""

ROD = RodLaw(
    "rod",
    "Bergou et al. 2008 and 2010, Spillmann and Teschner 2007",
    "edges that stretch, bend and twist, with a frame on each",
    rods_of,
)
"""The law of a `RodMaterial`. It is not in `LAWS`, for the same reason as `SHELL`."""


def element_model(
    law: LawName,
    strain: StrainName | None = None,
    flips: FlipsName | None = None,
    damping_model: DampingModelName = DampingModel.EDGE,
) -> ElementModel:
    """Return the force model of a law with options.

    Args:
        law: a key of `LAWS`, such as "neo_hookean"; "shell" or "rod".
        strain: "linear" or "exact"; None for the law's default.
        flips: "tolerant", "recover" or "off"; None for the law's default.
        damping_model: "edge", the default, or "tet_mean".
    Raises: OptionError for an unknown name, or for an option that the law does not support.
    """
    known = LAWS | {SHELL.name: SHELL, ROD.name: ROD}
    if not isinstance(law, str) or law not in known:
        raise OptionError(f"unknown law {law!r}: {choose_one_of(LAWS, law)}")
    chosen = known[law]
    damping = DampingModel.parse(damping_model)
    if isinstance(chosen, BondLaw | ShellLaw | RodLaw) and damping is not DampingModel.EDGE:
        raise OptionError(f"law {law!r} has no damping_model={damping.value!r}: use 'edge'")
    return ElementModel(
        chosen,
        _one_of(chosen, "strain", None if strain is None else Strain.parse(strain), chosen.strains),
        _one_of(chosen, "flips", None if flips is None else Flips.parse(flips), chosen.flips),
        damping,
    )


def default_law(material: AnyMaterial, strain: StrainName | None, flips: FlipsName | None) -> LawName:
    """Return the name of the default law for a material and options.

    The default is "springs" for a `SpringMaterial`, "shell" for a `ShellMaterial` and "rod" for a
    `RodMaterial`. It is "virial" for an `AnisotropicMaterial`, and for options that only the laws of the
    thesis support. Otherwise it is "neo_hookean". In the drop test with this law, no body froze and every
    inverted body recovered (`python -m lab drop-test --sweep`).
    """
    if isinstance(material, SpringMaterial):
        return "springs"
    if isinstance(material, ShellMaterial):
        return SHELL.name
    if isinstance(material, RodMaterial):
        return ROD.name
    if isinstance(material, AnisotropicMaterial) or strain is not None:
        return "virial"
    return "neo_hookean" if flips is None or flips is Flips.RECOVER or str(flips) == "recover" else "virial"


def fit_model(model: ElementModel, mesh: BodyMesh, material: AnyMaterial) -> ElementModel:
    """Return `model`, adapted to a mesh and a material.

    Raises: MeshError if the law does not support the mesh; MaterialError if it does not support the material.
    """
    law = model.law
    if not isinstance(mesh, BodyMesh):
        is_surface = hasattr(mesh, "faces") or hasattr(mesh, "geometry")
        hint = f": {fill_hint('mesh')}" if is_surface else ""
        raise MeshError(
            "mesh must be a TetMesh, a ParticleMesh, a ShellMesh or a RodMesh, "
            f"got {type(mesh).__name__}{hint}"
        )
    if not isinstance(material, AnyMaterial):
        raise MaterialError(f"material must be a taichi_soft.Material, got {type(material).__name__}")
    if isinstance(mesh, ShellMesh) or isinstance(material, ShellMaterial) or model.is_shell:
        return _fit_shell(model, mesh, material)
    if isinstance(mesh, RodMesh) or isinstance(material, RodMaterial) or model.is_rod:
        return _fit_rod(model, mesh, material)
    if isinstance(material, SpringMaterial) and law.name == "springs":
        if not isinstance(mesh, ParticleMesh):
            raise MaterialError("a SpringMaterial has no density: convert the mesh to a ParticleMesh first")
        return model
    if not isinstance(mesh, TetMesh):
        raise MeshError(NO_TETRAHEDRA.message(feature=f"law {law.name!r} of a {type(material).__name__}"))
    if isinstance(material, SpringMaterial):
        raise MaterialError(f"law {law.name!r} needs a Material, got {type(material).__name__}")
    if isinstance(material, AnisotropicMaterial):
        return _fit_anisotropic(model, len(mesh.tets), material)
    if isinstance(material, RigidMaterial) != isinstance(mesh, RigidMesh):
        raise MaterialError(f"a {type(material).__name__} does not fit {mesh!r}: use SoftBodyAsset.rigid")
    if isinstance(material, RigidMaterial):
        return replace(model, is_anisotropic=False)
    for name in CONSTANTS:
        if getattr(material, name) is not None:
            material.per_tet(name, len(mesh.tets))
    given = material.shear_modulus is not None or material.shear_damping is not None
    if given and not (isinstance(law, BondLaw) and law.takes_shear):
        raise MaterialError(f"law {law.name!r} has no shear_modulus and shear_damping: leave them out")
    return replace(model, is_anisotropic=False)


def _fit_shell(model: ElementModel, mesh: BodyMesh, material: AnyMaterial) -> ElementModel:
    if not isinstance(mesh, ShellMesh):
        raise MeshError(
            f"a {type(material).__name__} with law {model.law.name!r} needs a ShellMesh, got {mesh!r}"
        )
    if not isinstance(material, ShellMaterial):
        raise MaterialError(f"a ShellMesh needs a ShellMaterial, got a {type(material).__name__}")
    if not model.is_shell:
        raise MaterialError(f"law {model.law.name!r} does not support a ShellMaterial: leave out law")
    for name in model.law.parameters:
        material.per_triangle(name, len(mesh.triangles))
    return model


def _fit_rod(model: ElementModel, mesh: BodyMesh, material: AnyMaterial) -> ElementModel:
    if not isinstance(mesh, RodMesh):
        raise MeshError(
            f"a {type(material).__name__} with law {model.law.name!r} needs a RodMesh, got {mesh!r}"
        )
    if not isinstance(material, RodMaterial):
        raise MaterialError(f"a RodMesh needs a RodMaterial, got a {type(material).__name__}")
    if not model.is_rod:
        raise MaterialError(f"law {model.law.name!r} does not support a RodMaterial: leave out law")
    for name in model.law.parameters:
        material.per_edge(name, len(mesh.edges))
    return model


def _fit_anisotropic(model: ElementModel, tet_count: int, material: AnisotropicMaterial) -> ElementModel:
    if not model.law.takes_anisotropy:
        raise MaterialError(ANISOTROPIC_LAW.message(feature=f"law {model.law.name!r}"))
    material.require_count(tet_count)
    return replace(model, is_anisotropic=True)


def _one_of(
    law: Law, option: str, requested: ChoiceT | None, supported: tuple[ChoiceT, ...]
) -> ChoiceT | None:
    if requested is None:
        return supported[0] if supported else None
    if requested not in supported:
        names = " or ".join(repr(member.value) for member in supported)
        fix = f"pass {names}" if names else f"leave {option} out"
        raise OptionError(f"law {law.name!r} does not support {option}={requested.value!r}: {fix}")
    return requested
