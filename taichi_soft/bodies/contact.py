"""Contact properties of a body."""

from __future__ import annotations

from dataclasses import dataclass

from taichi_soft.core.checks import as_count, as_flag, as_friction, as_number
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.serialisation import serialised

DEFAULT_THICKNESS = 0.02
"""Default thickness of the contact layer, as a fraction of the mean edge length of the surface. A layer
this thin is invisible."""


RIGID_THICKNESS = 0.01
"""Default thickness of the contact layer of a rigid body, as a fraction of its smallest extent. The edges of
its surface can be as long as the body."""


@serialised("friction", "thickness", "itself", "group", "mask", "faces")
@dataclass(frozen=True)
class Contact:
    """Contact properties of a body's surface.

    Args:
        friction: Coulomb coefficient, 0 or more. Contact of two bodies uses the geometric mean of their
            coefficients. Contact with a collider uses the collider's coefficient.
        thickness: thickness of a layer on the surface [m]. Contact keeps two bodies apart by the mean of
            their thicknesses. None: 2 % of the mean edge length of the surface, 1 % of the smallest extent of
            a rigid body, the thickness of a shell, or the diameter of a rod.
        itself: True for self-contact. It acts between parts of the body that are more than 1.5 edge lengths
            apart at rest.
        group, mask: bit fields. Two bodies, or a body and a collider, collide if the mask of each object has
            a bit in common with the group of the other object.
        faces: False if only the vertices of the body touch colliders, not its edges and triangles. This suits
            a soft body that carries light rigid bodies of a game engine: see docs/coupling.md.
    Raises: OptionError for a value out of range.
    """

    friction: float = 0.5
    thickness: float | None = None
    itself: bool = False
    group: int = 1
    mask: int = ALL_GROUPS
    faces: bool = True

    def __post_init__(self) -> None:
        as_friction(self.friction)
        if self.thickness is not None:
            as_number(self.thickness, "thickness", 0.0, 1e3, "a length of 0 to 1000 m, or None")
        as_flag(self.itself, "itself")
        as_flag(self.faces, "faces")
        as_count(self.group, "group", 0, ALL_GROUPS)
        as_count(self.mask, "mask", 0, ALL_GROUPS)

    @property
    def filter(self) -> tuple[int, int]:
        """Group and mask."""
        return self.group, self.mask


DEFAULT_CONTACT = Contact()
