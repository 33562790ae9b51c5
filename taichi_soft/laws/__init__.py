"""Force laws by name. A new law is one file with its functions and one line here."""

from taichi_soft.errors import OptionError
from taichi_soft.laws.face import face_forces
from taichi_soft.laws.model import ElementModel, Law
from taichi_soft.laws.virial import virial_forces
from taichi_soft.types import DampingModel, Flips, Strain

__all__ = ["LAWS", "ElementModel", "Law", "element_model"]

LAWS = {
    law.name: law
    for law in (
        Law("virial", "6.3", "stress to vertex forces by the virial theorem", virial_forces),
        Law("face", "6.2", "stress to vertex forces by the four faces", face_forces),
    )
}


def element_model(
    law: str,
    strain: str | Strain = Strain.LINEAR,
    flips: str | Flips = Flips.TOLERANT,
    damping_model: str | DampingModel = DampingModel.EDGE,
) -> ElementModel:
    """The model that these names choose. Raises: OptionError for a name that is not known."""
    if not isinstance(law, str) or law not in LAWS:
        raise OptionError(f"unknown law {law!r}: choose one of {', '.join(map(repr, LAWS))}")
    return ElementModel(
        LAWS[law], Strain.parse(strain), Flips.parse(flips), DampingModel.parse(damping_model)
    )
