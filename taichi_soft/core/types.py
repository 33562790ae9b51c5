"""Enums of the public interface. Functions that accept a member also accept its string.

With the `...Name` types, editors complete the strings, and mypy rejects misspelt strings.
"""

from __future__ import annotations

import re
from enum import Enum
from typing import Literal, TypeAlias, TypeVar

from taichi_soft.core.checks import choose_one_of
from taichi_soft.core.errors import OptionError


class Choice(str, Enum):
    """Base class of options with named values. `parse` converts a user's string to a member."""

    @classmethod
    def parse(cls: type[ChoiceT], value: str | ChoiceT) -> ChoiceT:
        """Return the member that `value` names. Raises: OptionError with the valid names."""
        try:
            return cls(value)
        except ValueError:
            names = [member.value for member in cls]
            option = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", cls.__name__).lower()
            raise OptionError(f"unknown {option} {value!r}: {choose_one_of(names, value)}") from None


ChoiceT = TypeVar("ChoiceT", bound=Choice)


class Strain(Choice):
    """Measure of the strain of a tetrahedron with the deformation gradient F = U R."""

    LINEAR = "linear"  # 1/2 (F F^T - I), thesis eq. 6.7
    EXACT = "exact"  # sqrt(F F^T) - I, thesis chapter 7


class Flips(Choice):
    """Treatment of inverted tetrahedra by a law."""

    TOLERANT = "tolerant"  # the mirrored shape counts as a rest shape too (thesis)
    RECOVER = "recover"  # forces turn the tetrahedron back
    OFF = "off"  # no treatment


class DampingModel(Choice):
    """Velocity to which the damping constant applies."""

    EDGE = "edge"  # relative velocity along each edge, thesis eq. 3.9
    TET_MEAN = "tet_mean"  # velocity of a vertex minus the mean of its tetrahedron (rejected in thesis 6.4)


class Integrator(Choice):
    """Integrator of the equations of motion (thesis section 3.5)."""

    EXPLICIT_EULER = "explicit_euler"
    LEAPFROG = "leapfrog"
    LAZY_LEAPFROG = "lazy_leapfrog"
    IMPLICIT_EULER = "implicit_euler"


class Schedule(Choice):
    """Loop structure of a world's substeps."""

    AUTO = "auto"
    PER_BODY = "per_body"  # one thread runs all substeps of a body
    FLAT = "flat"  # all tetrahedra of all bodies in parallel, substep by substep


class Overlap(Choice):
    """Treatment of a body that is placed inside other bodies."""

    PART = "part"  # move the bodies apart over the next steps
    REFUSE = "refuse"  # raise an error


class JointKind(Choice):
    """Motion of a rigid body relative to the body to which it is connected."""

    BALL = "ball"  # turns about a point
    HINGE = "hinge"  # turns about an axis
    SLIDER = "slider"  # moves along an axis
    FIXED = "fixed"  # does not move


StrainName: TypeAlias = Strain | Literal["linear", "exact"]
FlipsName: TypeAlias = Flips | Literal["tolerant", "recover", "off"]
DampingModelName: TypeAlias = DampingModel | Literal["edge", "tet_mean"]
IntegratorName: TypeAlias = (
    Integrator | Literal["explicit_euler", "leapfrog", "lazy_leapfrog", "implicit_euler"]
)
ScheduleName: TypeAlias = Schedule | Literal["auto", "per_body", "flat"]
JointKindName: TypeAlias = JointKind | Literal["ball", "hinge", "slider", "fixed"]
OverlapName: TypeAlias = Overlap | Literal["part", "refuse"]
ArchName: TypeAlias = Literal["auto", "cpu", "cuda", "vulkan", "metal"]
CageMethodName: TypeAlias = Literal["lattice", "tetgen", "ftetwild"]
LawName: TypeAlias = Literal[
    "virial",
    "face",
    "st_venant_kirchhoff",
    "neo_hookean",
    "springs",
    "volume_springs",
    "cmpm",
    "cmpm2",
    "best_fitting_plane",
    "split_ring_plane",
    "tilted_plane",
    "tilted_plane_printed",
    "shell",
    "rod",
]
