"""What bodies hit: solid shapes that stand still, or move as the engine says."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.contact.fields import NO_COLLIDER, ContactCapacity, ContactFields
from taichi_soft.contact.kernels.collider_rows import (
    MOTION_WIDTH,
    sum_collider_impulses,
    write_collider_motion,
    write_samples,
)
from taichi_soft.contact.shapes import Shape
from taichi_soft.core.checks import as_count, as_number, as_rotation, as_vector
from taichi_soft.core.constants import ALL_GROUPS, VELOCITY_LIMIT
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, recorded
from taichi_soft.core.math.rotations import matrix_of, quaternion_of, rotation_vector, turned_by
from taichi_soft.core.serialisation import digest_of

Floats = NDArray[np.float64]

MOST_SAMPLES = 100_000_000
"""Of all grids that come after `World.build`: 400 MB."""

_FASTEST_SPIN = 1e4  # [rad/s]


@dataclass(eq=False)
class ColliderRow:
    """One collider: what it is, where it is, and how it moves through the next step."""

    shape: Shape
    friction: float
    restitution: float  # -1 for that of the bodies
    thickness: float
    group: int
    mask: int
    position: Floats
    rotation: Floats  # quaternion
    velocity: Floats
    spin: Floats
    offset: int  # of its samples, from `World.build` on
    target: tuple[Floats, Floats] | None = None  # pose at the end of the next step
    is_alive: bool = True

    @property
    def skin(self) -> float:
        """How far outside of the shape its surface is felt [m]."""
        return self.thickness + self.shape.seam

    @property
    def constants(self) -> tuple[Any, ...]:
        """All that does not move."""
        surface = (self.friction, self.restitution, self.thickness, self.group, self.mask)
        return (id(self.shape), self.offset, self.is_alive, *surface)


class Collider(Handle):
    """A handle to one collider. What it does to bodies it does through its surface: friction, restitution."""

    def __init__(self, colliders: Colliders, index: int, row: ColliderRow) -> None:
        """Made by `World.add_collider`."""
        self._set = weakref.ref(colliders)
        self._row = row
        self.index = index

    def __repr__(self) -> str:
        return f"Collider({self.index}, {self.shape!r}{'' if self.is_alive else ', removed'})"

    def _colliders(self) -> Colliders:
        """The set it belongs to. Raises: StateError where it, or its world, is gone."""
        colliders = self._set()
        if colliders is None:
            raise StateError(f"the world of collider {self.index} is gone: keep a reference to it")
        if not self.is_alive:
            raise StateError(f"collider {self.index} was removed: add another")
        return colliders

    @property
    def is_alive(self) -> bool:
        """False once it was removed."""
        return self._row.is_alive

    @property
    def shape(self) -> Shape:
        """What it is."""
        return self._row.shape

    @property
    def position(self) -> Floats:
        """Of its origin, (3,) [m]."""
        return np.array(self._row.position)

    @property
    def rotation(self) -> Floats:
        """Its axes as columns, (3, 3)."""
        matrix: Floats = matrix_of(self._row.rotation)
        return matrix

    @property
    def velocity(self) -> Floats:
        """Of its origin from the coming step on, (3,) [m/s]; zero where `move_to` takes it somewhere."""
        return np.array(self._row.velocity)

    @property
    def angular_velocity(self) -> Floats:
        """The same of its rotation, (3,) [rad/s]."""
        return np.array(self._row.spin)

    @property
    def friction(self) -> float:
        """Coulomb's coefficient."""
        return self._row.friction

    @property
    def restitution(self) -> float | None:
        """Of whole bodies; None for their own elasticity."""
        return None if self._row.restitution < 0.0 else self._row.restitution

    @property
    def thickness(self) -> float:
        """How far outside of its shape bodies meet it [m]."""
        return self._row.thickness

    @property
    def group(self) -> int:
        """Bits that bodies' masks are compared with."""
        return self._row.group

    @property
    def mask(self) -> int:
        """Bits of the groups of bodies that it touches."""
        return self._row.mask

    @property
    def impulse(self) -> Floats:
        """What bodies gave it in the last step, (3,) [N s]: apply it to the engine's rigid body.

        To that body's velocity for the coming step add half of it beforehand: it is about what that step
        will bring, and comes too late otherwise.
        """
        return self._colliders().impulses()[self.index, :3]

    @property
    def angular_impulse(self) -> Floats:
        """The same about its position, (3,) [N m s]."""
        return self._colliders().impulses()[self.index, 3:]

    @recorded
    def move_to(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Be there at the end of the next step, on a straight way and an even turn; then stand still.

        Bodies in the way are pushed with the velocity that this takes.
        Args:
            position: (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps the present one.
        Raises: OptionError for bad values.
        """
        colliders = self._colliders()
        self._row.target = self._pose(position, rotation)
        colliders.moved(self._row)

    @recorded
    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Move on like this until told otherwise: (3,) [m/s] and (3,) [rad/s] about its position."""
        colliders, row = self._colliders(), self._row
        velocity = as_vector(linear, "linear", "m/s", VELOCITY_LIMIT)
        spin = as_vector(angular, "angular", "rad/s", _FASTEST_SPIN)
        row.velocity, row.spin, row.target = velocity, spin, None
        colliders.moved(row)

    @recorded
    def teleport(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Be there at once, without pushing anything on the way; what it then covers is pressed out."""
        colliders, row = self._colliders(), self._row
        pose = self._pose(position, rotation)
        colliders.on_jump(*_box(row))
        row.position, row.rotation = pose
        row.target = None
        colliders.moved(row)
        colliders.on_jump(*_box(row))

    def _pose(self, position: ArrayLike, rotation: ArrayLike | None) -> tuple[Floats, Floats]:
        where = as_vector(position, "position", "m")
        return where, self._row.rotation if rotation is None else quaternion_of(as_rotation(rotation))

    @recorded
    def remove(self) -> None:
        """Take it out of the world; its place is free for another."""
        colliders = self._colliders()
        self._row.is_alive = False
        colliders.write(self.index)


def ignore(lower: Floats, upper: Floats) -> None:
    """What is told of jumps where nobody listens."""


class Colliders:
    """All colliders of one world: Python's side of `ContactFields`."""

    def __init__(self) -> None:
        self._rows: list[ColliderRow] = []
        self.shapes: dict[str, Shape] = {}  # all that there ever were, by their digests
        self._handles: list[Collider] = []
        self._contact: ContactFields | None = None
        self._body_count = 0
        self._impulses: Floats | None = None  # of the last step, once asked for
        # Told where a collider appears, vanishes, jumps from or jumps to: lower and upper corner [m].
        self.on_jump: Callable[[Floats, Floats], None] = ignore
        self._is_dirty = False  # whether poses or velocities differ from what the fields hold
        self._movers: list[ColliderRow] = []  # with a velocity or a target

    @property
    def handles(self) -> Sequence[Collider]:
        """Those that are alive."""
        return tuple(handle for handle, row in zip(self._handles, self._rows, strict=True) if row.is_alive)

    def handle(self, index: int) -> Collider:
        """The latest that had that row."""
        return self._handles[index]

    def add(
        self,
        shape: Shape,
        *,
        position: ArrayLike,
        rotation: ArrayLike | None,
        friction: float,
        restitution: float | None,
        thickness: float,
        group: int,
        mask: int,
    ) -> Collider:
        """See `World.add_collider`."""
        if not isinstance(shape, Shape):
            raise OptionError(f"shape must be one of taichi_soft's shapes, such as BoxShape, got {shape!r}")
        zero = np.zeros(3)
        row = ColliderRow(
            shape,
            as_number(friction, "friction", 0.0, 1e6, "a number from 0 to 1,000,000"),
            -1.0
            if restitution is None
            else as_number(restitution, "restitution", 0.0, 1.0, "a number from 0 to 1"),
            as_number(thickness, "thickness", 0.0, 1e3, "a length of 0 to 1000 m"),
            as_count(group, "group", 0, ALL_GROUPS),
            as_count(mask, "mask", 0, ALL_GROUPS),
            as_vector(position, "position", "m"),
            quaternion_of(as_rotation(rotation)),
            zero,
            zero,
            0,
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
        """A row for a new collider. Raises: StateError where there is none."""
        for index, row in enumerate(self._rows):
            if not row.is_alive:
                return index
        if self._contact is not None and len(self._rows) >= self._contact.capacity.colliders:
            raise StateError(
                f"there is room for {len(self._rows)} colliders and all are in use: remove one, or make the "
                "world with a larger collider_room"
            )
        return len(self._rows)

    def _free_samples(self, shape: Shape) -> int:
        """Where the grid of a new collider goes. Raises: StateError where there is no room for it."""
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
        """What these colliders and `room` more with so many samples need.

        Rounded up so that similar worlds share kernels.
        """
        count = len(self._rows) + room
        samples = sum(len(row.shape.samples) for row in self._rows) + sample_room
        return ContactCapacity(
            max(8, 1 << (count - 1).bit_length()) if count else 8,
            max(1024, 1 << (samples - 1).bit_length()) if samples else 0,
            soft,
        )

    def load(self, contact: ContactFields, body_count: int) -> None:
        """Fill the fields with what was added before `build`."""
        self._contact, self._body_count = contact, body_count
        if contact.capacity.samples:
            write_samples(contact, 0, np.zeros(1, dtype=np.float32))  # compiles
        begin = 0
        for row in self._rows:
            row.offset = begin
            begin += len(row.shape.samples)
            self._write_samples(row)
        self._write_constants()
        self._is_dirty = True

    def write(self, index: int) -> None:
        """Bring the fields up to date after row `index` was added or removed."""
        if self._contact is None:
            return
        row = self._rows[index]
        self._write_samples(row)
        self._write_constants()
        self._is_dirty = True
        self.on_jump(*_box(row))

    def _write_samples(self, row: ColliderRow) -> None:
        if row.is_alive and len(row.shape.samples):
            write_samples(self._contact, row.offset, np.ascontiguousarray(row.shape.samples))

    def _write_constants(self) -> None:
        contact, rows = self._contact, self._rows
        assert contact is not None
        contact.collider_count[None] = len(rows)
        fill = contact.loader.fill
        fill(contact.collider_kind, np.array([r.shape.kind if r.is_alive else NO_COLLIDER for r in rows]))
        fill(contact.collider_parameters, np.array([r.shape.parameters for r in rows]))
        fill(contact.collider_resolution, np.array([r.shape.resolution for r in rows]))
        fill(contact.collider_offset, np.array([r.offset for r in rows]))
        fill(contact.collider_surface, np.array([(r.friction, r.restitution, r.skin) for r in rows]))
        fill(contact.collider_filter, np.array([(r.group, r.mask) for r in rows]))
        contact.loader.write()

    def moved(self, row: ColliderRow) -> None:
        """Note that a collider is elsewhere, or moves differently, from the next step on."""
        self._is_dirty = True
        self._movers = [other for other in self._movers if other is not row]
        if row.target is not None or row.velocity.any() or row.spin.any():
            self._movers.append(row)

    def prepare(self, dt: float) -> bool:
        """Tell the fields where the colliders are and how they move through the coming step of `dt` [s].

        Returns: whether any may be elsewhere, or move otherwise, than in the step before.
        """
        self._impulses = None
        if not (self._is_dirty or self._movers):
            return False
        for row in self._movers:
            if row.target is not None:
                position, rotation = row.target
                row.velocity = (position - row.position) / dt
                row.spin = rotation_vector(row.rotation, rotation) / dt
        motion = np.empty((len(self._rows), MOTION_WIDTH), dtype=np.float32)
        for line, row in zip(motion, self._rows, strict=True):
            line[:] = np.concatenate([row.position, row.rotation, row.velocity, row.spin, *_way(row, dt)])
        write_collider_motion(self._contact, motion)
        self._is_dirty = False
        return True

    def finish(self, dt: float) -> None:
        """Take the colliders to where they are after a step of `dt` [s]."""
        for row in list(self._movers):
            if row.target is None:
                row.position = row.position + dt * row.velocity
                row.rotation = turned_by(row.rotation, dt * row.spin)
            else:
                row.position, row.rotation = row.target
                row.velocity, row.spin, row.target = np.zeros(3), np.zeros(3), None
                self.moved(row)

    @property
    def all_handles(self) -> Sequence[Collider]:
        """Of each row, removed ones among them."""
        return tuple(self._handles)

    def restore(
        self,
        rows: list[ColliderRow],
        handle_of: Callable[[int, ColliderRow], Collider],
    ) -> None:
        """Put back all rows, with the handles that `handle_of` finds."""
        before, after = [row.constants for row in self._rows], rows
        for handle in self._handles:
            handle._row.is_alive = False
        self._rows = after
        self._handles = [handle_of(index, row) for index, row in enumerate(after)]
        for index, (handle, row) in enumerate(zip(self._handles, after, strict=True)):
            handle.index, handle._row = index, row
        self._impulses, self._is_dirty, self._movers = None, True, []
        for row in after:
            self.moved(row)
        if self._contact is None or before == [row.constants for row in after]:
            return
        for row in after:
            self._write_samples(row)
        self._write_constants()

    def impulses(self) -> Floats:
        """Of the last step on each, (n, 6) [N s, N m s]; zero before the first."""
        if self._impulses is None:
            rows = np.zeros((len(self._rows), 6), dtype=np.float32)
            if self._contact is not None:
                sum_collider_impulses(self._contact, self._body_count, rows)
            self._impulses = rows.astype(np.float64)
        return np.array(self._impulses)


def _box(row: ColliderRow) -> tuple[Floats, Floats]:
    """Corners of a box round a collider where it is, (3,) [m] each."""
    lower, upper, _ = _way(row, 0.0)
    return lower, upper


def _way(row: ColliderRow, dt: float) -> tuple[Floats, Floats, Floats]:
    """Corners of a box round its way through `dt` [s], (3,) [m] each; its highest speed, (1,) [m/s]."""
    lower, upper = row.shape.bounds
    speed, spin = float(np.linalg.norm(row.velocity)), float(np.linalg.norm(row.spin))
    if not np.isfinite([lower, upper]).all():
        far = np.full(3, 1e30)
        return -far, far, np.array([speed if spin == 0.0 else 1e30])
    corners = np.array([[(lower, upper)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    radius = float(np.linalg.norm(corners, axis=1).max())
    places = corners @ matrix_of(row.rotation).T
    if spin > 0.0:
        places = radius * np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    start, end = row.position + places, row.position + dt * row.velocity + places
    both = np.concatenate([start, end])
    fastest = np.array([speed + spin * (radius + row.skin)])
    lowest: Floats = both.min(axis=0) - row.skin
    highest: Floats = both.max(axis=0) + row.skin
    return lowest, highest, fastest
