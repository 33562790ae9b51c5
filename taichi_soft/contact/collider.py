"""A collider: a solid shape with which bodies collide. The game can move a collider."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.contact.filters import as_filter
from taichi_soft.contact.shapes import Shape
from taichi_soft.core.checks import as_friction, as_rotation, as_vector
from taichi_soft.core.constants import VELOCITY_LIMIT
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import Handle, recorded
from taichi_soft.core.math.rotations import length_of, matrix_of, quaternion_of, turned

if TYPE_CHECKING:
    from taichi_soft.bodies.soft_body import SoftBody

Floats = NDArray[np.float64]

FASTEST_SPIN = 1e4
"""Largest angular speed of a collider [rad/s]."""


@dataclass(eq=False)
class ColliderRow:
    """Shape, surface, pose and motion of one collider."""

    shape: Shape
    friction: float
    restitution: float  # -1 if the elasticity of each body decides
    thickness: float
    group: int
    mask: int
    position: Floats
    rotation: Floats  # quaternion
    velocity: Floats
    spin: Floats
    surface_velocity: Floats  # relative to the collider, in its frame
    offset: int  # first row of the grid samples, after `World.build`
    target: tuple[Floats, Floats] | None = None  # pose at the end of the next step
    is_alive: bool = True
    is_sensor: bool = False

    @property
    def skin(self) -> float:
        """Distance outside the shape at which contact begins [m]: thickness plus the skin of the shape.

        Sensors have none, because nothing touches them.
        """
        return 0.0 if self.is_sensor else self.thickness + self.shape.seam

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Corners of the current bounding box of the collider, (3,) [m] each."""
        lower, upper, _ = self.swept_box(0.0)
        return lower, upper

    def swept_box(self, dt: float) -> tuple[Floats, Floats, Floats]:
        """Return the box that the collider sweeps in `dt` [s], and the highest speed of its points.

        Returns: lower and upper corner of the box, (3,) [m] each; the speed, (1,) [m/s].
        """
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
        """All values that stay the same when the collider moves."""
        surface = (self.friction, self.restitution, self.thickness, self.group, self.mask)
        kind = (id(self.shape), self.offset, self.is_alive, self.is_sensor)
        return (*kind, *surface, *self.surface_velocity.tolist())


class ColliderSet(Protocol):
    """The part of `Colliders` that handles use."""

    def jumped(self, row: ColliderRow) -> None:
        """Wake the bodies near a collider that appears, disappears or changes."""

    def filtered(self) -> None:
        """Record that the group or the mask of a collider changed."""

    def bodies_inside(self, index: int) -> tuple[SoftBody, ...]:
        """Return the bodies in the sensor in row `index`, in the order of their slots."""

    def impulses(self) -> Floats:
        """Return impulse and angular impulse on each collider in the last step, (n, 6) [N s, N m s]."""

    def moved(self, row: ColliderRow) -> None:
        """Record that the pose or the motion of a collider changed."""

    def write(self, index: int) -> None:
        """Update the fields after the collider in row `index` was added or removed."""

    def resurfaced(self, index: int) -> None:
        """Update fields and settings after the surface or the filter of a collider changed."""


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
        """Return the set that contains the collider.

        Raises: StateError if the collider was removed, or if its world no longer exists.
        """
        colliders = self._set()
        if colliders is None:
            raise StateError(f"the world of collider {self.index} is gone: keep a reference to it")
        if not self.is_alive:
            raise StateError(f"collider {self.index} was removed: add another")
        return colliders

    @property
    def is_alive(self) -> bool:
        """False after the collider was removed."""
        return self._row.is_alive

    @property
    def is_sensor(self) -> bool:
        """True for a sensor, which bodies do not touch: see `World.add_sensor`."""
        return self._row.is_sensor

    @property
    def bodies_inside(self) -> tuple[SoftBody, ...]:
        """Bodies that touch or enclose this sensor now, in the order of their slots. Sleeping bodies count.

        Raises: StateError for a collider that is not a sensor, and before `build`.
        """
        colliders = self._colliders()
        if not self.is_sensor:
            raise StateError(
                f"collider {self.index} is no sensor, so that no body can be in it: use World.add_sensor, or "
                "the events ContactBegan and ContactEnded"
            )
        return colliders.bodies_inside(self.index)

    @property
    def shape(self) -> Shape:
        """Shape of the collider."""
        return self._row.shape

    @property
    def position(self) -> Floats:
        """Position of the collider's origin, (3,) [m]."""
        return np.array(self._row.position)

    @property
    def rotation(self) -> Floats:
        """Axes of the collider as columns, (3, 3)."""
        matrix: Floats = matrix_of(self._row.rotation)
        return matrix

    @property
    def velocity(self) -> Floats:
        """Velocity of the origin from the next step on, (3,) [m/s]. It is zero for a collider that `move_to`
        moves.
        """
        return np.array(self._row.velocity)

    @property
    def angular_velocity(self) -> Floats:
        """Angular velocity from the next step on, (3,) [rad/s]."""
        return np.array(self._row.spin)

    @property
    def surface_velocity(self) -> Floats:
        """Velocity of the surface relative to the collider, in the collider's frame, (3,) [m/s]."""
        return np.array(self._row.surface_velocity)

    @property
    def friction(self) -> float:
        """Coulomb friction coefficient."""
        return self._row.friction

    @property
    def restitution(self) -> float | None:
        """Coefficient of restitution for the centres of mass of bodies; None if their elasticity decides."""
        return None if self._row.restitution < 0.0 else self._row.restitution

    @property
    def thickness(self) -> float:
        """Distance outside the shape at which contact begins [m]."""
        return self._row.thickness

    @property
    def group(self) -> int:
        """Groups of the collider, as bits."""
        return self._row.group

    @property
    def mask(self) -> int:
        """Groups of bodies that the collider touches, as bits."""
        return self._row.mask

    @property
    def impulse(self) -> Floats:
        """Impulse that all bodies exerted on the collider in the last step, (3,) [N s].

        Apply this impulse to the engine's rigid body. The impulse acts one step late. To compensate, add half
        of its velocity change to the rigid body before the next step, because the next impulse is similar.
        """
        return self._colliders().impulses()[self.index, :3]

    @property
    def angular_impulse(self) -> Floats:
        """Angular impulse that all bodies exerted on the collider in the last step, (3,) [N m s].

        The reference point is the position of the collider.
        """
        return self._colliders().impulses()[self.index, 3:]

    @recorded
    def set_friction(self, friction: float) -> None:
        """Change the friction coefficient from the next step on. Wakes sleeping bodies near the collider.

        Args:
            friction: Coulomb coefficient, 0 or more.
        Raises: OptionError for a number out of range; StateError if the collider was removed.
        """
        colliders, coefficient = self._colliders(), as_friction(friction)
        if coefficient != self._row.friction:
            self._row.friction = coefficient
            colliders.resurfaced(self.index)

    @recorded
    def set_filter(self, group: int, mask: int) -> None:
        """Change which bodies the collider touches, or the sensor reports, from the next step on.

        Contacts with bodies that it no longer touches end at once. Bodies that it now touches, and that it
        overlaps, are moved out. Sleeping bodies near the collider wake.
        Args:
            group, mask: groups as bits, see `World.add_collider`.
        Raises: OptionError for a value that is no bit field; StateError if the collider was removed.
        """
        colliders, new = self._colliders(), as_filter(group, mask)
        if new != (self.group, self.mask):
            self._row.group, self._row.mask = new
            colliders.resurfaced(self.index)
            colliders.filtered()

    @recorded
    def set_surface_velocity(self, velocity: ArrayLike) -> None:
        """Move the surface of the collider like a conveyor belt from the next step on; the collider itself
        stays where it is.

        Friction carries bodies along. Only the part of the velocity that is tangential to the surface counts
        at each contact. Bodies on the collider stay awake while its surface moves.
        Args:
            velocity: velocity of the surface relative to the collider, in the collider's frame, (3,) [m/s].
                Zero stops the surface.
        Raises: OptionError for bad values; StateError if the collider was removed.
        """
        colliders, new = self._colliders(), as_surface_velocity(velocity)
        if (new != self._row.surface_velocity).any():
            self._row.surface_velocity = new
            colliders.resurfaced(self.index)

    @recorded
    def move_to(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Move the collider to a pose during the next step, then stop it.

        The velocity and the angular velocity are constant during the step. The collider pushes bodies in its
        path with this velocity.
        Args:
            position: new position of the collider's origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps the current one.
        Raises: OptionError for bad values.
        """
        colliders = self._colliders()
        self._row.target = self._pose(position, rotation)
        colliders.moved(self._row)

    @recorded
    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Move the collider with this velocity until the next call of `set_velocity` or `move_to`.

        Args:
            linear: velocity of the origin, (3,) [m/s].
            angular: angular velocity about the origin, (3,) [rad/s]; zero by default.
        """
        colliders, row = self._colliders(), self._row
        velocity = as_vector(linear, "linear", "m/s", VELOCITY_LIMIT)
        spin = as_vector(angular, "angular", "rad/s", FASTEST_SPIN)
        row.velocity, row.spin, row.target = velocity, spin, None
        colliders.moved(row)

    @recorded
    def teleport(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Move the collider to a pose at once.

        The collider pushes no bodies between the two poses. Bodies that overlap the new pose are moved out.

        Args:
            position: new position of the collider's origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps the current one.
        """
        colliders, row = self._colliders(), self._row
        pose = self._pose(position, rotation)
        colliders.jumped(row)
        row.position, row.rotation = pose
        row.target = None
        colliders.moved(row)
        colliders.jumped(row)

    def _pose(self, position: ArrayLike, rotation: ArrayLike | None) -> tuple[Floats, Floats]:
        where = as_vector(position, "position", "m")
        return where, self._row.rotation if rotation is None else quaternion_of(as_rotation(rotation))

    @recorded
    def remove(self) -> None:
        """Remove the collider from the world. A collider that is added later can get the same index."""
        colliders = self._colliders()
        self._row.is_alive = False
        colliders.write(self.index)


def as_surface_velocity(velocity: ArrayLike) -> Floats:
    """Return the surface velocity of a collider, (3,) [m/s]. Raises: OptionError for bad values."""
    return as_vector(velocity, "surface_velocity", "m/s", VELOCITY_LIMIT)


def row_of(collider: Collider) -> ColliderRow:
    """Return the row of a collider."""
    return collider._row


def rebind(collider: Collider, index: int, row: ColliderRow) -> None:
    """Make a handle refer to another row."""
    collider.index, collider._row = index, row
