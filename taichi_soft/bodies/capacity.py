"""How much room the fields of a world have."""

from dataclasses import dataclass, replace
from typing import Any, TypeVar

from taichi_soft.bodies.layout import Scene
from taichi_soft.core.constants import LANES

ROOMS = "particles", "edges", "blocks", "triangles", "outer", "rings", "bodies"
"""The numbers of a `Capacity` that a world does not notice if they are larger than it needs."""


LEAST = dict.fromkeys(ROOMS, 512) | {"edges": 2048, "blocks": 128, "bodies": 8, "colliders": 8, "samples": 0}
"""Room that the smallest world has; the last two where there is contact."""

Room = TypeVar("Room", bound="BodyCapacity")


@dataclass(frozen=True)
class BodyCapacity:
    """Room in a state. Rounded up to powers of two, so that similar worlds share compiled kernels."""

    particles: int
    edges: int
    blocks: int
    bodies: int
    triangles: int
    outer: int
    parallel: bool  # room for the force of every corner and edge at once, as the flat schedule needs
    rings: int = 0  # rows of what lies round edges, and whether edges carry force at all
    implicit: bool = False  # room for the linear system of implicit integration
    anisotropic: bool = False  # room for 21 elastic constants per tetrahedron
    plastic: bool = False  # room for the first rest shapes of bodies that can be bent for good
    double: bool = False  # float64 instead of float32: to evaluate forces, not to move

    @classmethod
    def of(
        cls: type[Room],
        scene: Scene,
        *,
        parallel: bool = False,
        implicit: bool = False,
        plastic: bool = False,
        double: bool = False,
        **others: Any,
    ) -> Room:
        """Room for `scene`. Lanes of its last body read on behind its particles and triangles.

        Args: others: by name, of what a subclass adds.
        """
        return cls(
            room_for(scene.particle_count + LANES, "particles"),
            room_for(scene.edge_count, "edges"),
            room_for(scene.block_count, "blocks"),
            room_for(len(scene.bodies), "bodies"),
            room_for(scene.triangle_count + LANES, "triangles"),
            room_for(scene.outer_count, "outer"),
            parallel,
            room_for(scene.ring_count, "rings") if scene.has_bonds else 0,
            implicit,
            any(body.stiffness.any() for body in scene.bodies),
            plastic,
            double,
            **others,
        )

    @property
    def rooms(self) -> list[int]:
        """How much room there is, in the order of `ROOMS`."""
        return [getattr(self, name) for name in ROOMS]

    def has_room_for(self, other: "BodyCapacity") -> bool:
        """Whether a state of this capacity has the fields of one of `other`, and none of them shorter."""
        widened = {name: max(getattr(self, name), getattr(other, name)) for name in ROOMS}
        return replace(other, **widened) == self and (self.rings > 0) == (other.rings > 0)


def room_for(count: int, name: str) -> int:
    """A power of two."""
    return max(LEAST[name], 1 << max(count - 1, 0).bit_length())
