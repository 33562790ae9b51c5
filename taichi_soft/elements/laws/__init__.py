"""Force laws by name. A new law is one file with its functions and one line here."""

from dataclasses import replace
from functools import partial

from taichi_soft.core.checks import choose_one_of
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
from taichi_soft.elements.laws.law import SOLID, BondLaw, EnergyLaw, Law, StressLaw
from taichi_soft.elements.laws.model import ElementModel
from taichi_soft.elements.laws.neo_hookean import neo_hookean_energy, neo_hookean_piola, neo_hookean_principal
from taichi_soft.elements.laws.springs import spring_bonds
from taichi_soft.elements.laws.st_venant_kirchhoff import (
    st_venant_kirchhoff_energy,
    st_venant_kirchhoff_piola,
    st_venant_kirchhoff_principal,
)
from taichi_soft.elements.laws.tilted_plane import PRINTED, tilted_plane_bonds
from taichi_soft.elements.laws.virial import virial_forces
from taichi_soft.elements.laws.volume_springs import volume_spring_bonds
from taichi_soft.elements.materials import CONSTANTS, AnisotropicMaterial, AnyMaterial, SpringMaterial
from taichi_soft.meshing import BodyMesh, ParticleMesh, TetMesh
from taichi_soft.meshing.advice import filling

__all__ = [
    "LAWS",
    "BondLaw",
    "ElementModel",
    "EnergyLaw",
    "Law",
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
            "thesis 6.4 asks for it",
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
            "rubber that keeps its energy and comes back from every flip",
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
            "springs, and tetrahedra that pull their edges together as they grow",
            Ring.EXPANSION,
            volume_spring_bonds,
            SOLID,
        ),
        BondLaw(
            "cmpm",
            "thesis 4.1",
            "a spring along and one across each edge, told apart by its Voronoi face",
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
            "the same with a plane fitted to the particles round the edge",
            Ring.PLANE,
            best_fitting_plane_bonds,
        ),
        BondLaw(
            "tilted_plane",
            "thesis 4.4.3",
            "the same with a plane that the particles round the edge tilt",
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


def element_model(
    law: LawName,
    strain: StrainName | None = None,
    flips: FlipsName | None = None,
    damping_model: DampingModelName = DampingModel.EDGE,
) -> ElementModel:
    """The model that these names choose; None takes the law's own.

    Args:
        law: a key of `LAWS`, such as "neo_hookean".
        strain: "linear" or "exact"; None takes the default of the law.
        flips: "tolerant", "recover" or "off"; None takes the default of the law.
        damping_model: "edge", the default, or "tet_mean".
    Raises: OptionError for a name that is not known or that the law does not take.
    """
    if not isinstance(law, str) or law not in LAWS:
        raise OptionError(f"unknown law {law!r}: {choose_one_of(LAWS, law)}")
    chosen = LAWS[law]
    damping = DampingModel.parse(damping_model)
    if isinstance(chosen, BondLaw) and damping is not DampingModel.EDGE:
        raise OptionError(f"law {law!r} has no damping_model={damping.value!r}: it takes 'edge'")
    return ElementModel(
        chosen,
        _one_of(chosen, "strain", None if strain is None else Strain.parse(strain), chosen.strains),
        _one_of(chosen, "flips", None if flips is None else Flips.parse(flips), chosen.flips),
        damping,
    )


def default_law(material: AnyMaterial, strain: StrainName | None, flips: FlipsName | None) -> LawName:
    """Name of the law that a body has where none is named.

    Neo-Hookean: no body froze by it, and every wreck came back (`python -m lab drop-test --sweep`). The
    virial one for options that only the thesis's laws have and for an `AnisotropicMaterial`; springs for a
    `SpringMaterial`.
    """
    if isinstance(material, SpringMaterial):
        return "springs"
    if isinstance(material, AnisotropicMaterial) or strain is not None:
        return "virial"
    return "neo_hookean" if flips is None or flips is Flips.RECOVER or str(flips) == "recover" else "virial"


def fit_model(model: ElementModel, mesh: BodyMesh, material: AnyMaterial) -> ElementModel:
    """The model that this mesh and this material need.

    Raises: MeshError or MaterialError where a law cannot be made of them.
    """
    law = model.law
    if not isinstance(mesh, BodyMesh):
        is_surface = hasattr(mesh, "faces") or hasattr(mesh, "geometry")
        advice = f": {filling('mesh')}" if is_surface else ""
        raise MeshError(f"mesh must be a TetMesh or a ParticleMesh, got {type(mesh).__name__}{advice}")
    if not isinstance(material, AnyMaterial):
        raise MaterialError(f"material must be a taichi_soft.Material, got {type(material).__name__}")
    if isinstance(material, SpringMaterial) and law.name == "springs":
        if not isinstance(mesh, ParticleMesh):
            raise MaterialError("a SpringMaterial tells no density: turn the mesh into a ParticleMesh first")
        return model
    if not isinstance(mesh, TetMesh):
        raise MeshError(
            f"law {law.name!r} needs tetrahedra: pass a TetMesh, or law='springs' and a SpringMaterial for a "
            "ParticleMesh"
        )
    if isinstance(material, SpringMaterial):
        raise MaterialError(f"law {law.name!r} needs a Material, got {type(material).__name__}")
    if isinstance(material, AnisotropicMaterial):
        return _fit_anisotropic(model, len(mesh.tets), material)
    for name in CONSTANTS:
        if getattr(material, name) is not None:
            material.per_tet(name, len(mesh.tets))
    given = material.shear_modulus is not None or material.shear_damping is not None
    if given and not (isinstance(law, BondLaw) and law.takes_shear):
        raise MaterialError(f"law {law.name!r} takes no shear_modulus or shear_damping of its own")
    return replace(model, is_anisotropic=False)


def _fit_anisotropic(model: ElementModel, tet_count: int, material: AnisotropicMaterial) -> ElementModel:
    if not model.law.takes_anisotropy:
        takers = ", ".join(repr(law.name) for law in LAWS.values() if law.takes_anisotropy)
        raise MaterialError(f"law {model.law.name!r} takes no AnisotropicMaterial: {takers} do")
    material.require_count(tet_count)
    return replace(model, is_anisotropic=True)


def _one_of(law: Law, option: str, asked: ChoiceT | None, taken: tuple[ChoiceT, ...]) -> ChoiceT | None:
    if asked is None:
        return taken[0] if taken else None
    if asked not in taken:
        names = " or ".join(repr(member.value) for member in taken) or "none"
        raise OptionError(f"law {law.name!r} has no {option}={asked.value!r}: it takes {names}")
    return asked
