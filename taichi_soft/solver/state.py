"""All Taichi fields of one world: those of its bodies, and of what a game switches on."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.capacity import BodyCapacity
from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.layout import Scene
from taichi_soft.contact.fields import ContactCapacity, ContactFields, SoftContactFields
from taichi_soft.contact.hull_fields import HullFields
from taichi_soft.control.kernels.grabs import GrabFields
from taichi_soft.control.kernels.joints import JointFields
from taichi_soft.control.kernels.motors import MotorFields
from taichi_soft.core.runtime import holds_fields
from taichi_soft.core.settings import Settings
from taichi_soft.solver.kernels.surroundings import write_surroundings
from taichi_soft.solver.step_fields import JobFields, Progress

_NO_CONTACT = ContactCapacity()


@dataclass(frozen=True)
class Capacity(BodyCapacity):
    """Room in a state."""

    contact: ContactCapacity = _NO_CONTACT

    @property
    def has_contact(self) -> bool:
        """Whether there are fields of contact."""
        return self.contact != _NO_CONTACT


@holds_fields
class State(BodyFields):
    """The fields of bodies, and those of each slice that a world has."""

    capacity: Capacity

    def __init__(self, capacity: Capacity) -> None:
        """Allocate `capacity`; contents are zero until `load`."""
        super().__init__(capacity)
        n, bodies = capacity.particles, capacity.bodies
        self.grabs, self.motors = GrabFields(self.real), MotorFields(bodies)
        if capacity.has_contact:
            self.contact = ContactFields(capacity.contact, n, bodies)
            self.joints = JointFields(n)
        if capacity.contact.soft:
            self.soft = SoftContactFields(n, bodies, capacity.outer, capacity.triangles)
        if capacity.contact.hull:
            self.hull = HullFields(n, bodies, capacity.outer, capacity.triangles, soft=capacity.contact.soft)
        self.progress = Progress.field(shape=bodies)  # type: ignore[attr-defined]  # of each island
        if capacity.has_contact:
            self.jobs = JobFields(bodies)

    @property
    def touching(self) -> Any:
        """Where the fields are that say what of each body touches others."""
        return self.hull if self.capacity.contact.hull else self

    @property
    def carried(self) -> dict[str, list[list[Any]]]:
        """Fields of slices that the next step depends on, in groups: see `Slice.row_counts`."""
        groups = {"grabs": self.grabs.carried(), "motors": self.motors.carried()}
        if self.capacity.has_contact:
            groups["joints"], groups["colliders"] = self.joints.carried(), self.contact.carried()
        if self.capacity.contact.soft:
            for group, fields in zip(groups["colliders"], self.soft.carried(), strict=False):
                group += fields
        if self.capacity.contact.hull:
            groups["colliders"][0] += self.hull.carried()
        return groups

    def write_surroundings(self, settings: Settings) -> None:
        """Write what holds for all bodies: gravity, the floor of a world without colliders, how exact a step
        is."""
        floor = settings.floor or 0.0, settings.restitution or 0.0, settings.friction
        solver = settings.tolerance, settings.most_iterations
        write_surroundings(self, np.array([*settings.gravity, *floor, *solver, settings.retries]))

    def load(self, scene: Scene, models: list[int], kinds: NDArray[np.float64] | None = None) -> None:
        """As `BodyFields.load`."""
        self.grabs.clear(self.loader)
        self.motors.clear(self.loader)
        if self.capacity.has_contact:
            self._load_contact(scene)
        super().load(scene, models, kinds)

    def _load_contact(self, scene: Scene) -> None:
        fill, contact, count = self.loader.fill, self.contact, len(scene.bodies)
        fill(contact.near_count, np.zeros(0))
        # Of slots that stay empty too: what colliders are told is a sum over all.
        fill(contact.impulse, np.zeros((0, 3)))
        fill(contact.angular_impulse, np.zeros((0, 3)))
        fill(contact.rebound, np.zeros(0))
        fill(self.joints.bodies, np.zeros((0, 2)))
        fill(self.joints.is_held, np.zeros(0))
        for numbers in (self.joints.particle, self.joints.weight, self.joints.share):
            fill(numbers, np.zeros(0))
        # What lies inside a body is never near anything.
        fill(contact.particle_clearance, np.full(scene.particle_count, np.inf))
        fill(contact.particle_touches, np.zeros(0))
        fill(contact.island_count, np.array([count]))
        fill(contact.island_first, np.arange(count + 1))
        fill(contact.island_body, np.arange(count))
        fill(contact.body_island, np.arange(count))
        if self.capacity.contact.hull:
            self.hull.load(self.loader, scene)
        if self.capacity.contact.soft:
            fill(self.soft.sweep_order, np.arange(count))
            fill(self.soft.slot_count, np.zeros(0))
            fill(self.soft.contact_count, np.zeros(0))
            fill(self.soft.kept_normal_impulse, np.zeros(0))
            fill(self.soft.records_touches, np.zeros(0))
            fill(self.soft.pairs_lost, np.zeros(0))
            fill(self.soft.overlap, np.zeros(0))
            fill(self.soft.partner_count, np.zeros(0))
            fill(self.soft.pair_bodies, np.zeros((0, 2)))
            fill(self.soft.pair_impulse, np.zeros((0, 3)))
