"""Capacity of the fields of a world."""

from dataclasses import dataclass, replace
from typing import Any, TypeVar

from taichi_soft.bodies.layout import Scene
from taichi_soft.core.constants import LANES
from taichi_soft.core.field_table import BLOCK, BODY, EDGE, OUTER, PARTICLE, RING, SHELL, TRIANGLE, WORLD

ROOMS = "particles", "edges", "blocks", "triangles", "outer", "rings", "shells", "bodies"
"""Attributes of a `BodyCapacity` that can be larger than a world needs."""


LEAST = dict.fromkeys(ROOMS, 512) | {"edges": 2048, "blocks": 128, "shells": 128, "bodies": 8}
LEAST |= {"colliders": 8, "samples": 0, "contact_edges": 128}
"""Smallest capacity of a world, by attribute. The attributes of the second line exist only in worlds with
contact."""

Room = TypeVar("Room", bound="BodyCapacity")


@dataclass(frozen=True)
class BodyCapacity:
    """Capacity of the fields of a world, in powers of two so that similar worlds share compiled kernels."""

    particles: int
    edges: int
    blocks: int
    bodies: int
    triangles: int
    outer: int
    parallel: bool  # True adds fields for the forces of corners and edges; for schedule `flat`
    rings: int = 0  # number of rows of edge rings; 0 if no edges carry elastic forces
    shells: int = 0  # number of blocks of shell elements; 0 if no body is a shell
    implicit: bool = False  # True adds fields for the linear system of implicit integration
    anisotropic: bool = False  # True adds fields for 21 elastic constants per tetrahedron
    plastic: bool = False  # True adds fields for the original rest shapes of plastic bodies
    rods: bool = False  # True adds fields for the frames of rods
    double: bool = False  # True uses float64 instead of float32, to evaluate forces without motion

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
        """Return the capacity for `scene`, with `LANES` spare particles and triangles.

        Vector code reads the spare rows beyond the last body.
        Args: others: values of the attributes that a subclass adds.
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
            room_for(scene.shell_count, "shells") if scene.shell_count else 0,
            implicit,
            any(body.stiffness.any() for body in scene.bodies),
            plastic,
            any(body.rods is not None for body in scene.bodies),
            double,
            **others,
        )

    @property
    def has_hulls(self) -> bool:
        """True if the state has fields for hulls."""
        return False

    @property
    def has_rigid(self) -> bool:
        """True if the state has fields for rigid bodies."""
        return False

    @property
    def rooms(self) -> list[int]:
        """Capacities in the order of `ROOMS`."""
        return [getattr(self, name) for name in ROOMS]

    @property
    def solves_bonds(self) -> bool:
        """True if implicit integration solves for edges that carry elastic forces."""
        return self.implicit and self.rings > 0

    @property
    def names_edges(self) -> bool:
        """True if the fields store the edges of each tetrahedron."""
        return self.implicit or self.rings > 0

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows of each group of fields, by the group's name in `declare`."""
        return {
            WORLD: 1,
            PARTICLE: self.particles,
            EDGE: self.edges,
            BLOCK: self.blocks,
            BODY: self.bodies,
            TRIANGLE: self.triangles,
            OUTER: self.outer,
            RING: self.rings,
            SHELL: self.shells,
        }

    def has_room_for(self, other: "BodyCapacity") -> bool:
        """True if fields of this capacity can hold a world of capacity `other`.

        Both capacities must have the same optional fields, and no field of this capacity may be shorter.
        """
        widened = {name: max(getattr(self, name), getattr(other, name)) for name in ROOMS}
        has_same_fields = all(
            (getattr(self, name) > 0) == (getattr(other, name) > 0) for name in ("rings", "shells")
        )
        return replace(other, **widened) == self and has_same_fields


def room_for(count: int, name: str) -> int:
    """Return the smallest power of two that is at least `count`, but not less than `LEAST[name]`."""
    return max(LEAST[name], 1 << max(count - 1, 0).bit_length())
