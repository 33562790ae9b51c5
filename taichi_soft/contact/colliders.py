"""All colliders of a world, and their contribution to snapshots."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.capacity import LEAST, room_for
from taichi_soft.bodies.soft_body import Context, RowsOf, Slice, SoftBody
from taichi_soft.contact.collider import Collider, ColliderRow, as_surface_velocity, rebind, row_of
from taichi_soft.contact.collider_entries import entry_of, read_row
from taichi_soft.contact.fields import MAX_IMPULSE, NO_COLLIDER, ColliderFields, ContactCapacity
from taichi_soft.contact.filters import as_filter
from taichi_soft.contact.kernels.collider_rows import (
    MOTION_WIDTH,
    SPEED,
    forget_collider,
    sum_collider_impulses,
    write_collider_motion,
    write_samples,
)
from taichi_soft.contact.sensors import inside_sensors
from taichi_soft.contact.shapes import Shape, SphereShape
from taichi_soft.core.checks import as_friction, as_number, as_rotation, as_vector
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.math.rotations import quaternion_of, rotation_vector, turned_by
from taichi_soft.core.residue import rounding_error
from taichi_soft.core.serialisation import digest_of

Floats = NDArray[np.float64]

MOST_SAMPLES = 100_000_000
"""Largest `sample_room` of a world: number of grid samples for colliders that are added after `World.build`.
These samples take 400 MB."""


def ignore(lower: Floats, upper: Floats) -> None:
    """Do nothing. This function is the default of `Colliders.on_jump`."""


class Colliders(Slice):
    """All colliders of a world. Their data are stored in Python and copied to `ColliderFields`."""

    name = "colliders"

    def __init__(self, context: Context) -> None:
        """Start without colliders."""
        super().__init__(context)
        self._rows: list[ColliderRow] = []
        self.shapes: dict[str, Shape] = {}  # all shapes that were ever added, by digest
        self._handles: list[Collider] = []
        self.floor: Collider | None = None  # set by `World.build` in a world with colliders
        self._contact: ColliderFields | None = None
        self._body_count = 0
        self._built_count = 0  # number of colliders at `World.build`, including the floor
        self._impulses: Floats | None = None  # impulses in the last step; None until they are read
        # Called with two corners [m] of a collider's box, when the collider appears or disappears, when its
        # surface changes, and before and after it jumps.
        self.on_jump: Callable[[Floats, Floats], None] = ignore
        self._is_dirty = False  # True if poses or velocities must be written to the fields
        self._movers: list[ColliderRow] = []  # colliders with a velocity or a target

    @property
    def handles(self) -> Sequence[Collider]:
        """Handles of the colliders that were not removed."""
        return tuple(handle for handle, row in zip(self._handles, self._rows, strict=True) if row.is_alive)

    def handle(self, index: int) -> Collider:
        """Return the latest handle of row `index`."""
        return self._handles[index]

    def add(
        self,
        shape: Shape,
        *,
        position: ArrayLike,
        rotation: ArrayLike | None,
        group: int,
        mask: int,
        friction: float = 0.5,
        restitution: float | None = None,
        thickness: float = 0.0,
        surface_velocity: ArrayLike = (0.0, 0.0, 0.0),
        is_sensor: bool = False,
    ) -> Collider:
        """Implement `World.add_collider` and `World.add_sensor`."""
        if not isinstance(shape, Shape):
            raise OptionError(f"shape must be one of taichi_soft's shapes, such as BoxShape, got {shape!r}")
        zero = np.zeros(3)
        row = ColliderRow(
            shape,
            as_friction(friction),
            -1.0
            if restitution is None
            else as_number(restitution, "restitution", 0.0, 1.0, "a number from 0 to 1"),
            as_number(thickness, "thickness", 0.0, 1e3, "a length of 0 to 1000 m"),
            *as_filter(group, mask),
            as_vector(position, "position", "m"),
            quaternion_of(as_rotation(rotation)),
            zero,
            zero,
            as_surface_velocity(surface_velocity),
            0,
            is_sensor=is_sensor,
        )
        index, row.offset = self._free_row(), self._free_samples(shape)
        self.shapes[digest_of(shape)] = shape
        if index < len(self._rows):
            self._rows[index] = row
            self._handles[index] = Collider(self, index, row)
        else:
            self._rows.append(row)
            self._handles.append(Collider(self, index, row))
        if self._contact is not None:
            self.write(index)
        return self._handles[index]

    def _free_row(self) -> int:
        """Return the index of a free row for a new collider. Raises: StateError if no row is free."""
        for index, row in enumerate(self._rows):
            if not row.is_alive:
                return index
        if self._contact is not None and len(self._rows) >= self._contact.capacity.colliders:
            raise StateError(
                f"{len(self._rows)} colliders are in use, and the world has room for "
                f"{self._contact.capacity.colliders}: remove one, or make the world with "
                f"World(collider_room={len(self._rows) + 1 - self._built_count}) or more, or add colliders "
                "before build()"
            )
        return len(self._rows)

    def _free_samples(self, shape: Shape) -> int:
        """Return the first row for the grid samples of a new collider, 0 without a grid.

        Raises: StateError if there are too few free rows in sequence.
        """
        needed = len(shape.samples)
        if self._contact is None or needed == 0:
            return 0
        gaps, begin = [], 0
        used = sorted((row.offset, len(row.shape.samples)) for row in self._rows if row.is_alive)
        for offset, count in [*used, (self._contact.capacity.samples, 0)]:
            gaps.append((begin, offset - begin))
            begin = max(begin, offset + count)
        found = next((begin for begin, room in gaps if room >= needed), None)
        if found is None:
            raise StateError(
                f"the grid of {shape!r} takes {needed:,} samples, and there is room for "
                f"{max(room for _, room in gaps):,}: make the world with a larger sample_room, or add it "
                "before build()"
            )
        return found

    def capacity(self, room: int, sample_room: int, *, soft: bool) -> ContactCapacity:
        """Return the capacity for the current colliders plus `room` colliders and `sample_room` samples.

        The capacity is rounded up, so that similar worlds share kernels.
        """
        count = len(self._rows) + room
        samples = sum(len(row.shape.samples) for row in self._rows) + sample_room
        return ContactCapacity(
            room_for(count, "colliders"),
            room_for(max(samples, 1024), "samples") if samples else LEAST["samples"],
            soft,
        )

    def load(self, colliders: ColliderFields, body_count: int) -> None:
        """Fill the fields with the colliders that were added before `build`."""
        self._contact, self._body_count, self._impulses = colliders, body_count, None
        self._built_count = len(self._rows)
        if colliders.capacity.samples:
            write_samples(colliders, 0, np.zeros(1, dtype=np.float32))  # compile the kernel
        begin = 0
        for row in self._rows:
            row.offset = begin
            begin += len(row.shape.samples)
            self._write_samples(row)
        self._write_constants()
        self._is_dirty = True

    def write(self, index: int) -> None:
        """Update the fields after the collider in row `index` was added or removed."""
        if self._contact is None:
            return
        row = self._rows[index]
        if row.is_alive:
            forget_collider(self._contact, self._body_count, index)
        self._impulses = None
        self._write_samples(row)
        self._write_constants()
        self._is_dirty = True
        self.jumped(row)

    def jumped(self, row: ColliderRow) -> None:
        """Wake the bodies near a collider that appears, disappears or changes. Sensors wake no body."""
        if not row.is_sensor:
            self.on_jump(*row.box)

    def bodies_inside(self, index: int) -> tuple[SoftBody, ...]:
        """Return the bodies in the sensor in row `index`, in the order of their slots."""
        state, slots = self.context.built.state, self.context.slots.slots
        found = inside_sensors(state, len(slots), {index: self._rows[index]})
        return tuple(body for body in (slots[slot] for slot, _ in found) if body is not None)

    def filtered(self) -> None:
        """Record that the group or the mask of a collider changed."""
        if self._contact is not None:
            self.context.built.on_filtered()

    @property
    def sensors(self) -> dict[int, ColliderRow]:
        """Rows of the sensors that were not removed, by index."""
        return {index: row for index, row in enumerate(self._rows) if row.is_sensor and row.is_alive}

    def resurfaced(self, index: int) -> None:
        """Update fields and settings after the surface or the filter of a collider changed."""
        row = self._rows[index]
        if self._handles[index] is self.floor:
            self.context.apply_settings(replace(self.context.settings, friction=row.friction))
        if self._contact is not None:
            self._write_constants()
            self.jumped(row)

    def _write_samples(self, row: ColliderRow) -> None:
        if row.is_alive and len(row.shape.samples):
            write_samples(self._contact, row.offset, np.ascontiguousarray(row.shape.samples))

    def _write_constants(self) -> None:
        colliders, rows = self._contact, self._rows
        assert colliders is not None
        colliders.count[None] = len(rows)
        fill = colliders.loader.fill
        fill(colliders.kind, np.array([r.shape.kind if r.is_alive else NO_COLLIDER for r in rows]))
        fill(colliders.parameters, np.array([r.shape.parameters for r in rows]))
        fill(colliders.resolution, np.array([r.shape.resolution for r in rows]))
        fill(colliders.offset, np.array([r.offset for r in rows]))
        fill(colliders.surface, np.array([(r.friction, r.restitution, r.skin) for r in rows]))
        fill(colliders.surface_velocity, np.array([r.surface_velocity for r in rows]))
        # No body has a bit of an empty group, so that no kernel of contact sees a sensor.
        fill(colliders.filter, np.array([(0, 0) if r.is_sensor else (r.group, r.mask) for r in rows]))
        colliders.loader.write()

    def moved(self, row: ColliderRow) -> None:
        """Record that the pose or the motion of a collider changed."""
        self._is_dirty = self._is_dirty or not row.is_sensor
        self._movers = [other for other in self._movers if other is not row]
        if row.target is not None or row.velocity.any() or row.spin.any():
            self._movers.append(row)

    def prepare(self, dt: float) -> bool:
        """Write poses and motion of the colliders for the next step of `dt` [s] to the fields.

        Returns: True if any pose or motion can differ from the last step.
        """
        self._impulses = None
        if not (self._is_dirty or self._movers):
            return False
        for row in self._movers:
            if row.target is not None:
                position, rotation = row.target
                row.velocity = (position - row.position) / dt
                row.spin = rotation_vector(row.rotation, rotation) / dt
        if not self._is_dirty and all(row.is_sensor for row in self._movers):
            return False
        motion = np.empty((len(self._rows), MOTION_WIDTH), dtype=np.float32)
        for line, row in zip(motion, self._rows, strict=True):
            motion_now = row.position, row.rotation, row.velocity, row.spin, *row.swept_box(dt)
            line[:] = np.concatenate([*motion_now, rounding_error(row.position)])
            if row.is_sensor:
                line[SPEED] = 0.0  # by which moving colliders wake bodies
        write_collider_motion(self._contact, motion)
        self._is_dirty = False
        return True

    def finish(self, dt: float) -> None:
        """Move the colliders to their poses after a step of `dt` [s]."""
        for row in list(self._movers):
            if row.target is None:
                row.position = row.position + dt * row.velocity
                row.rotation = turned_by(row.rotation, dt * row.spin)
            else:
                row.position, row.rotation = row.target
                row.velocity, row.spin, row.target = np.zeros(3), np.zeros(3), None
                self.moved(row)

    def shift_origin(self, offset: Floats) -> None:
        """See `Slice.shift_origin`."""
        for row in self._rows:
            row.position = row.position - offset
            if row.target is not None:
                row.target = (row.target[0] - offset, row.target[1])
        self._is_dirty = True

    @property
    def all_handles(self) -> Sequence[Collider]:
        """Handles of all rows, including removed colliders."""
        return tuple(self._handles)

    def entries(self) -> list[list[Any]]:
        """Return handle number, row and motion of each collider as plain data: see `entry_of`."""
        return [entry_of(handle) for handle in self._handles]

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, ColliderRow]]:
        """Return the handle number and the row of each collider in `entries`.

        Raises: ValueError, SnapshotError or OptionError for an invalid entry, or if the world has too little
        capacity.
        """
        room = ContactCapacity() if self._contact is None else self._contact.capacity
        if len(entries) > room.colliders:
            raise ValueError(f"it has {len(entries)} colliders; this world has room for {room.colliders}")
        return [(int(entry[0]), read_row(entry, self.shapes, room.samples)) for entry in entries]

    def require(self, read: Any, rows_of: RowsOf) -> None:
        """Raise a ValueError if an impulse on a hull point is above `MAX_IMPULSE` or not finite."""
        if self._contact is not None and self._contact.capacity.hull:
            hull = self.context.built.state.hull
            is_held = rows_of(hull.held_by).max(axis=1) > 0
            for field in hull.held_impulses:
                if not np.abs(rows_of(field)[is_held]).max(initial=0.0) <= MAX_IMPULSE:
                    raise ValueError("impulses on hulls are too large, or not finite")

    def restore(self, read: Any) -> None:
        """Replace all colliders by the result of `read`."""
        before, handles = [row.constants for row in self._rows], self.context.handles
        for handle in self._handles:
            row_of(handle).is_alive = False
        self._rows, self._handles = [row for _, row in read], []
        for index, (serial, row) in enumerate(read):
            handle = handles.find(serial, Collider) or Collider(self, index, row)
            handles.enlist(handle, serial)
            rebind(handle, index, row)
            self._handles.append(handle)
        self._impulses, self._is_dirty, self._movers = None, True, []
        for row in self._rows:
            self.moved(row)
        if self._contact is None or before == [row.constants for row in self._rows]:
            return
        for row in self._rows:
            self._write_samples(row)
        self._write_constants()

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Add a collider, move it, read its impulse and remove it, so that no kernel compiles later."""
        if self._contact is None:
            return
        added: Collider | None = None
        forget_collider(self._contact, self._body_count, 0)  # compile this even if no collider can be added
        with contextlib.suppress(StateError):  # raised if no collider can be added
            added = self.add(
                SphereShape(1.0),
                position=(0.0, 0.0, 0.0),
                rotation=None,
                friction=0.5,
                restitution=None,
                thickness=0.0,
                group=1,
                mask=ALL_GROUPS,
            )
            self.context.handles.enlist(added)
            added.move_to((0.0, 0.0, 1.0))
        step()
        # The kernel of sensors is the same for any collider.
        slots, rows = len(self.context.slots.slots), dict(enumerate(self._rows[:1]))
        inside_sensors(self.context.built.state, slots, rows)
        for collider in self.handles[:1]:
            _ = collider.impulse
        if added is not None:
            added.remove()

    def impulses(self) -> Floats:
        """Return impulse and angular impulse on each collider in the last step, (n, 6) [N s, N m s].

        All values are zero before the first step.
        """
        if self._impulses is None:
            rows = np.zeros((len(self._rows), 6), dtype=np.float32)
            if self._contact is not None:
                sum_collider_impulses(self._contact, self._body_count, rows)
            self._impulses = rows.astype(np.float64)
        return np.array(self._impulses)
