"""A collider: a solid shape that bodies hit. It stands still, or moves as the engine says."""

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
    """Shape, surface, pose and motion of one collider."""

    shape: Shape
    friction: float
    restitution: float  # -1: the bodies' own elasticity
    thickness: float
    group: int
    mask: int
    position: Floats
    rotation: Floats  # quaternion
    velocity: Floats
    spin: Floats
    offset: int  # first row of its samples, from `World.build` on
    target: tuple[Floats, Floats] | None = None  # pose at the end of the next step
    is_alive: bool = True

    @property
    def skin(self) -> float:
        """Distance outside the shape at which bodies touch it [m]."""
        return self.thickness + self.shape.seam

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Corners of its present bounding box, (3,) [m] each."""
        lower, upper, _ = self.swept_box(0.0)
        return lower, upper

    def swept_box(self, dt: float) -> tuple[Floats, Floats, Floats]:
        """Return corners of the box swept in `dt` [s], (3,) [m] each, and the highest speed, (1,) [m/s]."""
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
        """Everything except pose and motion."""
        surface = (self.friction, self.restitution, self.thickness, self.group, self.mask)
        return (id(self.shape), self.offset, self.is_alive, *surface)


class ColliderSet(Protocol):
    """The part of `Colliders` that a handle uses."""

    on_jump: Callable[[Floats, Floats], None]

    def impulses(self) -> Floats:
        """Return the impulses of the last step on each collider, (n, 6) [N s, N m s]."""

    def moved(self, row: ColliderRow) -> None:
        """Record that the pose or the motion of a collider changed."""

    def write(self, index: int) -> None:
        """Update the fields after a row was added or removed."""

    def resurfaced(self, index: int) -> None:
        """Update fields and settings after the friction of a row changed."""


class Collider(Handle):
    """Handle of one collider."""

    def __init__(self, colliders: ColliderSet, index: int, row: ColliderRow) -> None:
        """Use `World.add_collider` instead."""
        self._set = weakref.ref(colliders)
        self._row = row
        self.index = index

    def __repr__(self) -> str:
        return f"Collider({self.index}, {self.shape!r}{'' if self.is_alive else ', removed'})"

    def _colliders(self) -> ColliderSet:
        """Return the set that it belongs to. Raises: StateError if it was removed, or its world is gone."""
        colliders = self._set()
        if colliders is None:
            raise StateError(f"the world of collider {self.index} is gone: keep a reference to it")
        if not self.is_alive:
            raise StateError(f"collider {self.index} was removed: add another")
        return colliders

    @property
    def is_alive(self) -> bool:
        """False once the collider was removed."""
        return self._row.is_alive

    @property
    def shape(self) -> Shape:
        """Its shape."""
        return self._row.shape

    @property
    def position(self) -> Floats:
        """Position of its origin, (3,) [m]."""
        return np.array(self._row.position)

    @property
    def rotation(self) -> Floats:
        """Its axes as columns, (3, 3)."""
        matrix: Floats = matrix_of(self._row.rotation)
        return matrix

    @property
    def velocity(self) -> Floats:
        """Velocity of its origin from the coming step on, (3,) [m/s]; zero if `move_to` moves it."""
        return np.array(self._row.velocity)

    @property
    def angular_velocity(self) -> Floats:
        """Angular velocity from the coming step on, (3,) [rad/s]."""
        return np.array(self._row.spin)

    @property
    def friction(self) -> float:
        """Coulomb's friction coefficient."""
        return self._row.friction

    @property
    def restitution(self) -> float | None:
        """Coefficient of restitution of the bodies' centres of mass; None for the bodies' own elasticity."""
        return None if self._row.restitution < 0.0 else self._row.restitution

    @property
    def thickness(self) -> float:
        """Distance outside the shape at which bodies touch it [m]."""
        return self._row.thickness

    @property
    def group(self) -> int:
        """Its groups, as bits."""
        return self._row.group

    @property
    def mask(self) -> int:
        """Groups of bodies that it touches, as bits."""
        return self._row.mask

    @property
    def impulse(self) -> Floats:
        """Impulse of all bodies on it in the last step, (3,) [N s]. Apply it to the engine's rigid body.

        It arrives one step late. The impulse of the coming step is about the same: add half of its effect to
        that body's velocity before the step.
        """
        return self._colliders().impulses()[self.index, :3]

    @property
    def angular_impulse(self) -> Floats:
        """Angular impulse of all bodies on it in the last step, about its position, (3,) [N m s]."""
        return self._colliders().impulses()[self.index, 3:]

    @recorded
    def set_friction(self, friction: float) -> None:
        """Change the friction coefficient from the next step on. Wakes bodies that sleep near it.

        Args:
            friction: Coulomb's coefficient, 0 or more.
        Raises: OptionError for a number out of range; StateError if it was removed.
        """
        colliders, coefficient = self._colliders(), as_friction(friction)
        if coefficient != self._row.friction:
            self._row.friction = coefficient
            colliders.resurfaced(self.index)

    @recorded
    def move_to(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Move there over the next step, in a straight line and with constant rotation, then stop.

        Bodies in its path are pushed with the velocity that this requires.
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
        """Keep moving with this velocity until the next call.

        Args:
            linear: velocity of its origin, (3,) [m/s].
            angular: angular velocity about its origin, (3,) [rad/s]; zero by default.
        """
        colliders, row = self._colliders(), self._row
        velocity = as_vector(linear, "linear", "m/s", VELOCITY_LIMIT)
        spin = as_vector(angular, "angular", "rad/s", FASTEST_SPIN)
        row.velocity, row.spin, row.target = velocity, spin, None
        colliders.moved(row)

    @recorded
    def teleport(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Move there at once, without pushing bodies in between. Bodies that it covers there are moved out.

        Args:
            position: new position of its origin, (3,) [m].
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
        """Remove it from the world. Another collider can use its place."""
        colliders = self._colliders()
        self._row.is_alive = False
        colliders.write(self.index)


def row_of(collider: Collider) -> ColliderRow:
    """Return the row of a collider."""
    return collider._row


def rebind(collider: Collider, index: int, row: ColliderRow) -> None:
    """Point a handle to another row."""
    collider.index, collider._row = index, row
