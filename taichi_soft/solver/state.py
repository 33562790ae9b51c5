"""All Taichi fields of one world: the fields of its bodies and of the features that the world uses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.capacity import BodyCapacity
from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.rigid_fields import RigidFields
from taichi_soft.contact.face_fields import FaceFields
from taichi_soft.contact.fields import ColliderFields, ContactCapacity, SoftContactFields
from taichi_soft.contact.hull_fields import HullFields
from taichi_soft.control.kernels.grabs import GrabFields
from taichi_soft.control.kernels.joints import JointFields
from taichi_soft.control.kernels.motors import MotorFields
from taichi_soft.core.field_table import (
    BODY,
    COLLIDER,
    CONTACT,
    CONTACT_EDGE,
    FEATURE,
    GRID_CELL,
    SAMPLE,
    SHAPE,
    Declaration,
    FieldGroup,
    declare,
)
from taichi_soft.core.settings import Settings
from taichi_soft.solver.kernels.surroundings import write_surroundings
from taichi_soft.solver.step_fields import IslandFields, JobFields, Progress

_NO_CONTACT = ContactCapacity()


@dataclass(frozen=True)
class Capacity(BodyCapacity):
    """Capacity of all fields of a state, including the fields for contact."""

    contact: ContactCapacity = _NO_CONTACT

    @property
    def has_contact(self) -> bool:
        """True if the state has fields for contact."""
        return self.contact != _NO_CONTACT

    @property
    def has_soft_contact(self) -> bool:
        """True if the state has fields for contact between bodies."""
        return self.contact.soft

    @property
    def has_hulls(self) -> bool:
        """True if the state has fields for hulls."""
        return self.contact.hull

    @property
    def has_rigid(self) -> bool:
        """True if the state has fields for rigid bodies."""
        return self.contact.rigid

    def has_room_for(self, other: BodyCapacity) -> bool:
        """True if a state of this capacity has all fields of a state of capacity `other`, none shorter."""
        assert isinstance(other, Capacity)
        edges = max(self.contact.edges, other.contact.edges)
        return super().has_room_for(replace(other, contact=replace(other.contact, edges=edges)))

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows for each group of fields: `BodyCapacity.counts` and the groups for contact."""
        colliders = self.contact.colliders
        return super().counts | {
            COLLIDER: colliders,
            SAMPLE: max(self.contact.samples, 1),
            CONTACT: self.bodies * colliders,
            CONTACT_EDGE: self.contact.edges,
            FEATURE: self.outer + self.contact.edges,
            GRID_CELL: 4 * (self.outer + self.contact.edges) + self.bodies,
        }


_FIELDS: WeakKeyDictionary[State, list[tuple[str, Declaration, Any]]] = WeakKeyDictionary()
"""Result of `State.fields` for each state. It is not an attribute of the state, because it would then change
the cache keys of kernels."""


class State(BodyFields):
    """Fields of bodies, and a group of fields for each feature that a world uses."""

    capacity: Capacity
    grabs: GrabFields
    motors: MotorFields
    islands: IslandFields
    colliders: ColliderFields
    joints: JointFields
    soft: SoftContactFields
    hull: HullFields
    rigid: RigidFields
    faces: FaceFields
    jobs: JobFields

    progress = declare(BODY, Progress, below={}, native=True)  # progress of each island

    GROUPS: ClassVar[dict[str, type[FieldGroup]]] = {
        "grabs": GrabFields,
        "motors": MotorFields,
        "islands": IslandFields,
        "colliders": ColliderFields,
        "joints": JointFields,
        "soft": SoftContactFields,
        "hull": HullFields,
        "rigid": RigidFields,
        "faces": FaceFields,
        "jobs": JobFields,
    }
    """Class of each group of fields, by the attribute of the state that contains the group."""

    def __init__(self, capacity: Capacity) -> None:
        """Allocate all fields. They contain zeros until `load`."""
        super().__init__(capacity)
        self.groups: dict[str, FieldGroup] = {}
        for name, kind in self.GROUPS.items():
            if not kind.when or getattr(capacity, kind.when):
                self.groups[name] = kind(capacity, self.real)
                setattr(self, name, self.groups[name])
        _FIELDS[self] = self.declared()
        for prefix, group in self.groups.items():
            _FIELDS[self] += [(f"{prefix}.{name}", each, field) for name, each, field in group.declared()]
        # Fields that a snapshot stores, by group of rows, each as (field, first column, width). The next
        # step, or a read before it, depends on these fields. All other fields are constant, follow from the
        # assets, or are written in each step before they are read.
        self.kept = self._kept()

    @property
    def fields(self) -> list[tuple[str, Declaration, Any]]:
        """All fields, as (name, declaration, field). Kernels use the same names, such as `grabs.body`."""
        return _FIELDS[self]

    @property
    def touching(self) -> Any:
        """Group that contains the fields of the bodies' contact surfaces."""
        return self.hull if self.capacity.contact.hull else self

    def is_kept(self, declared: Declaration) -> bool:
        """True if snapshots store the field. They store rest shapes only in worlds with plasticity."""
        return declared.keep != "" and (declared.keep != SHAPE or self.capacity.plastic)

    def _kept(self) -> dict[str, list[tuple[Any, int, int]]]:
        found: dict[str, list[tuple[Any, int, int]]] = {}
        for _, each, field in self.fields:
            if self.is_kept(each):
                group = found.setdefault(each.keep, [])
                group.append((field, sum(width for *_, width in group), getattr(field, "n", 1)))
        return found

    def write_surroundings(self, settings: Settings) -> None:
        """Write the settings common to all bodies: gravity, the floor of a world without colliders, tolerance
        and iterations of implicit Euler, and the number of retries.
        """
        floor = settings.floor or 0.0, settings.restitution or 0.0, settings.friction
        solver = settings.tolerance, settings.most_iterations
        write_surroundings(self, np.array([*settings.gravity, *floor, *solver, settings.retries]))

    def load(self, scene: Scene, models: list[int], kinds: NDArray[np.float64] | None = None) -> None:
        """Fill all groups from `scene`. The arguments are those of `BodyFields.load`."""
        if self.capacity.has_contact:
            self.islands.load(self.loader, len(scene.bodies))
            self.faces.load(self.loader, scene)
        if self.capacity.has_hulls:
            self.hull.load(self.loader, scene)
        if self.capacity.has_rigid:
            self.rigid.load(self.loader, scene)
        for group in self.groups.values():
            group.fill_starts(self.loader)
        if self.capacity.has_soft_contact:
            self.soft.load(self.loader, scene)
        super().load(scene, models, kinds)
