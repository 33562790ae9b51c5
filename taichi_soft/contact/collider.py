"""What bodies hit: a solid shape that stands still, or moves as the engine says."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.contact.shapes import Shape
from taichi_soft.core.checks import as_friction, as_rotation, as_vector
from taichi_soft.core.constants import VELOCITY_LIMIT
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import Handle, recorded
from taichi_soft.core.math.rotations import length_of, matrix_of, quaternion_of, turned

Floats = NDArray[np.float64]

FASTEST_SPIN = 1e4
"""[rad/s]"""


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
    def box(self) -> tuple[Floats, Floats]:
        """Corners of a box round it where it is, (3,) [m] each."""
        lower, upper, _ = self.way(0.0)
        return lower, upper

    def way(self, dt: float) -> tuple[Floats, Floats, Floats]:
        """Corners of a box round its way through `dt` [s], (3,) [m] each; its highest speed, (1,) [m/s]."""
        lower, upper = self.shape.bounds
        speed, spin = length_of(self.velocity), length_of(self.spin)
        if not np.isfinite([lower, upper]).all():
            far = np.full(3, 1e30)
            return -far, far, np.array([speed if spin == 0.0 else 1e30])
        corners = np.array([[(lower, upper)[i >> k & 1][k] for k in range(3)] for i in range(8)])
        x, y, z = corners.T
        radius = float(np.sqrt(x * x + y * y + z * z).max())
        places = turned(corners, matrix_of(self.rotation))
        if spin > 0.0:
            places = radius * np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
        start, end = self.position + places, self.position + dt * self.velocity + places
        both = np.concatenate([start, end])
        fastest = np.array([speed + spin * (radius + self.skin)])
        lowest: Floats = both.min(axis=0) - self.skin
        highest: Floats = both.max(axis=0) + self.skin
        return lowest, highest, fastest

    @property
    def constants(self) -> tuple[Any, ...]:
        """All that does not move."""
        surface = (self.friction, self.restitution, self.thickness, self.group, self.mask)
        return (id(self.shape), self.offset, self.is_alive, *surface)


class ColliderSet(Protocol):
    """All colliders of a world, as far as one of them asks."""

    on_jump: Callable[[Floats, Floats], None]

    def impulses(self) -> Floats:
        """Of the last step on each, (n, 6) [N s, N m s]."""

    def moved(self, row: ColliderRow) -> None:
        """Note that a collider is elsewhere, or moves differently, from the next step on."""

    def write(self, index: int) -> None:
        """Bring the fields up to date after a row was added or removed."""

    def resurfaced(self, index: int) -> None:
        """Bring fields and settings up to date after a row was given another friction."""


class Collider(Handle):
    """A handle to one collider. What it does to bodies it does through its surface: friction, restitution."""

    def __init__(self, colliders: ColliderSet, index: int, row: ColliderRow) -> None:
        """Use `World.add_collider` instead."""
        self._set = weakref.ref(colliders)
        self._row = row
        self.index = index

    def __repr__(self) -> str:
        return f"Collider({self.index}, {self.shape!r}{'' if self.is_alive else ', removed'})"

    def _colliders(self) -> ColliderSet:
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
    def set_friction(self, friction: float) -> None:
        """Change Coulomb's coefficient, from the next step on; bodies that sleep near it wake.

        Args:
            friction: Coulomb's coefficient, 0 or more.
        Raises: OptionError for a number out of range; StateError once it was removed.
        """
        colliders, coefficient = self._colliders(), as_friction(friction)
        if coefficient != self._row.friction:
            self._row.friction = coefficient
            colliders.resurfaced(self.index)

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
        """Move on like this until told otherwise: (3,) [m/s] and (3,) [rad/s] about its position.

        Args:
            linear: velocity of its origin, (3,) [m/s].
            angular: turn about its origin, (3,) [rad/s]; zero by default.
        """
        colliders, row = self._colliders(), self._row
        velocity = as_vector(linear, "linear", "m/s", VELOCITY_LIMIT)
        spin = as_vector(angular, "angular", "rad/s", FASTEST_SPIN)
        row.velocity, row.spin, row.target = velocity, spin, None
        colliders.moved(row)

    @recorded
    def teleport(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Be there at once, without pushing anything on the way; what it then covers is pressed out.

        Args:
            position: where its origin goes, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps the present one.
        """
        colliders, row = self._colliders(), self._row
        pose = self._pose(position, rotation)
        colliders.on_jump(*row.box)
        row.position, row.rotation = pose
        row.target = None
        colliders.moved(row)
        colliders.on_jump(*row.box)

    def _pose(self, position: ArrayLike, rotation: ArrayLike | None) -> tuple[Floats, Floats]:
        where = as_vector(position, "position", "m")
        return where, self._row.rotation if rotation is None else quaternion_of(as_rotation(rotation))

    @recorded
    def remove(self) -> None:
        """Take it out of the world; its place is free for another."""
        colliders = self._colliders()
        self._row.is_alive = False
        colliders.write(self.index)


def row_of(collider: Collider) -> ColliderRow:
    """What there is of it."""
    return collider._row


def rebind(collider: Collider, index: int, row: ColliderRow) -> None:
    """Let a handle stand for another row."""
    collider.index, collider._row = index, row
