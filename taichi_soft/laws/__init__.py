"""Force laws by name. A new law is one file with its functions and one line here."""

from taichi_soft.errors import OptionError
from taichi_soft.laws.face import face_forces
from taichi_soft.laws.law import EnergyLaw, Law, StressLaw
from taichi_soft.laws.model import ElementModel
from taichi_soft.laws.neo_hookean import neo_hookean_energy, neo_hookean_piola
from taichi_soft.laws.st_venant_kirchhoff import st_venant_kirchhoff_energy, st_venant_kirchhoff_piola
from taichi_soft.laws.virial import virial_forces
from taichi_soft.types import ChoiceT, DampingModel, Flips, Strain

__all__ = ["LAWS", "ElementModel", "Law", "element_model"]

LAWS: dict[str, Law] = {
    law.name: law
    for law in (
        StressLaw("virial", "thesis 6.3", "Hooke's stress to forces by the virial theorem", virial_forces),
        StressLaw("face", "thesis 6.2", "Hooke's stress to forces by the four faces", face_forces),
        EnergyLaw(
            "st_venant_kirchhoff",
            "thesis 6.4 asks for it",
            "Hooke's law as the derivative of an energy: no drift without damping",
            st_venant_kirchhoff_piola,
            st_venant_kirchhoff_energy,
            (Strain.LINEAR,),
            (Flips.TOLERANT,),
        ),
        EnergyLaw(
            "neo_hookean",
            "Smith, de Goes and Kim 2018",
            "rubber that keeps its energy and comes back from every flip",
            neo_hookean_piola,
            neo_hookean_energy,
            (),
            (Flips.RECOVER,),
        ),
    )
}


def element_model(
    law: str,
    strain: str | Strain | None = None,
    flips: str | Flips | None = None,
    damping_model: str | DampingModel = DampingModel.EDGE,
) -> ElementModel:
    """The model that these names choose; None takes the law's own.

    Raises: OptionError for a name that is not known or that the law does not take.
    """
    if not isinstance(law, str) or law not in LAWS:
        raise OptionError(f"unknown law {law!r}: choose one of {', '.join(map(repr, LAWS))}")
    chosen = LAWS[law]
    return ElementModel(
        chosen,
        _one_of(chosen, "strain", None if strain is None else Strain.parse(strain), chosen.strains),
        _one_of(chosen, "flips", None if flips is None else Flips.parse(flips), chosen.flips),
        DampingModel.parse(damping_model),
    )


def _one_of(law: Law, option: str, asked: ChoiceT | None, taken: tuple[ChoiceT, ...]) -> ChoiceT | None:
    if asked is None:
        return taken[0] if taken else None
    if asked not in taken:
        names = " or ".join(repr(member.value) for member in taken) or "none"
        raise OptionError(f"law {law.name!r} has no {option}={asked.value!r}: it takes {names}")
    return asked
