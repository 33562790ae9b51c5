"""Motors, which rotate a part of a body about an axis, or push it along an axis, at a target speed."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody, context_of
from taichi_soft.control.change import (
    change,
    mass_of,
    named_particles,
    numbers,
    require_per_body,
    rows_of,
)
from taichi_soft.control.kernels.motors import (
    MOST_MOTORS,
    MOTOR_ROWS,
    USED_MOTORS,
    find_rest_axis,
    forget_impulse,
    read_speed,
    write_drive,
    write_motors,
)
from taichi_soft.control.numbered import Numbered
from taichi_soft.core.checks import as_flag, as_number, as_vector
from taichi_soft.core.constants import VELOCITY_LIMIT
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, handles_of, recorded, serial_of
from taichi_soft.core.math.rotations import length_of
from taichi_soft.core.serialisation import below, indices_below, vector_of

LARGEST_LIMIT = 1e12
"""Largest torque [N m] or force [N] that a caller can set as the limit of a motor."""


@dataclass
class Drive:
    """Settings of a motor."""

    turns: bool  # True: rotates about the axis, False: pushes along the axis
    is_fixed: bool  # True: the axis keeps its direction, False: the axis rotates with the particles
    axis: NDArray[np.float64]  # unit vector, (3,); in world axes if `is_fixed`, else in the rest shape
    point: NDArray[np.float64] | None  # point on the axis, (3,) [m]; None: the centre of the particles
    speed: float  # target speed [rad/s] or [m/s]
    limit: float  # largest torque [N m] or force [N]

    @property
    def unit(self) -> str:
        """Unit of the motor's speed."""
        return "rad/s" if self.turns else "m/s"


THINNEST = 1e-3
"""Smallest ratio of width to length of the driven part. For a thinner part, the rotation about its long
axis is undefined."""


class Motor(Handle):
    """A motor that rotates or pushes a part of a body. Returned by `World.add_motor`."""

    def __init__(self, body: SoftBody, number: int, particles: NDArray[np.int32], drive: Drive) -> None:
        """Use `World.add_motor` instead."""
        self.body = body
        self.particles = particles
        self._number = number
        self._drive = drive

    def __repr__(self) -> str:
        state = f"{self.speed:g} {self._drive.unit}" if self.is_mounted else "removed"
        return f"Motor(body {self.body.index}, {len(self.particles)} particles, {state})"

    @property
    def is_mounted(self) -> bool:
        """True until the motor or its body is removed."""
        return self.body.is_alive and self._motors.by_number.get(self._number) is self

    @property
    def turns(self) -> bool:
        """True if the motor rotates its particles about the axis, False if it pushes them along the axis."""
        return self._drive.turns

    @property
    def speed(self) -> float:
        """Target speed [rad/s], or [m/s] if the motor pushes."""
        return self._drive.speed

    @property
    def limit(self) -> float:
        """Largest torque [N m], or largest force [N] if the motor pushes."""
        return self._drive.limit

    @property
    def measured_speed(self) -> float:
        """Measured speed about the axis [rad/s] or along it [m/s]; 0 while the body is frozen.

        Raises: StateError after removal.
        """
        self._require_mounted()
        state = context_of(self.body).built.state
        return 0.0 if self.body.is_frozen else float(read_speed(state, self._number))

    @property
    def effort(self) -> float:
        """Mean torque [N m] or force [N] of the motor during the last step; 0 while the body is frozen.

        Raises: StateError after removal.
        """
        self._require_mounted()
        context = context_of(self.body)
        impulse = 0.0 if self.body.is_frozen else float(context.built.state.motors.impulse[self._number])
        return impulse / max(context.clock.last_dt, 1e-30)

    @recorded
    def set_speed(self, speed: float) -> None:
        """Set the target speed.

        Args:
            speed: speed about the axis [rad/s], or along it [m/s] if the motor pushes; can be negative.
        Raises: OptionError for a number out of range; StateError after removal.
        """
        self._set(_as_speed(speed, self._drive.turns), self.limit)

    @recorded
    def set_limit(self, limit: float) -> None:
        """Set the limit of the torque or force. With the limit 0, the motor has no effect.

        Args:
            limit: largest torque [N m], or largest force [N] if the motor pushes; 0 or more.
        Raises: as `set_speed`.
        """
        self._set(self.speed, _as_limit(limit, "limit"))

    @recorded
    def remove(self) -> None:
        """Remove the motor. The particles keep their velocities. Raises: StateError if already removed."""
        self._require_mounted()
        motors = self._motors
        del motors.by_number[self._number]
        change(self.body, write_motors, *motors.rows())

    @property
    def _motors(self) -> Motors:
        return context_of(self.body).of(Motors)

    def _set(self, speed: float, limit: float) -> None:
        self._require_mounted()
        change(self.body, write_drive, self._number, speed, limit)
        self._drive.speed, self._drive.limit = speed, limit

    def _require_mounted(self) -> None:
        if not self.is_mounted:
            raise StateError(f"this motor of body {self.body.index} was removed: add another")


class Motors(Numbered[Motor]):
    """All motors of one world, by number."""

    name = "motors"
    most, advice_verb = MOST_MOTORS, "remove"

    @property
    def rows_in_use(self) -> int:
        """Total number of particles of all motors."""
        return sum(len(motor.particles) for motor in self.by_number.values())

    def release_body(self, body: SoftBody) -> None:
        """Remove all motors of a body."""
        for motor in self.holding(body):
            motor.remove()

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Compile the kernels, by adding a motor to a body and reading its effort."""
        with contextlib.suppress(OptionError):  # one particle has no width, but the call compiles the kernel
            _rest_axis(body, np.zeros(1, dtype=np.int32), np.array([0.0, 0.0, 1.0]))
        with contextlib.suppress(StateError):  # if all motors are in use, the kernels are compiled already
            motor = self.add(body, [0], (0.0, 0.0, 1.0), 0.0, None, 0.0, True, None)
            motor.set_speed(1.0)
            step()
            _ = motor.effort, motor.measured_speed
            motor.remove()

    def rows(self) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.int32]]:
        """Return all motors in the layout of `write_motors`."""
        wholes, reals, particles, first = [], [], [], 0
        for number, motor in sorted(self.by_number.items()):
            drive, end = motor._drive, first + len(motor.particles)
            has_point, point = drive.point is not None, np.zeros(3) if drive.point is None else drive.point
            wholes.append([number, motor.body.index, first, end, drive.turns, drive.is_fixed, has_point])
            reals.append(numbers(drive.axis, point, drive.speed, drive.limit))
            particles.append(rows_of(motor.body, motor.particles))
            first = end
        return (
            np.array(wholes, dtype=np.int32).reshape(-1, 7),
            np.array(reals, dtype=np.float32).reshape(-1, 8),
            np.concatenate([*particles, np.zeros(0)]).astype(np.int32),
        )

    def shift_origin(self, offset: NDArray[np.float64]) -> None:
        """See `Slice.shift_origin`. The fields contain the points in float32."""
        for motor in self.handles:
            if motor._drive.point is not None:
                point = motor._drive.point.astype(np.float32).astype(np.float64)
                motor._drive.point = (point - offset).astype(np.float32).astype(np.float64)

    def entries(self) -> list[list[Any]]:
        """List each motor's serial number, index, body, particles and settings."""
        return [
            [
                *(serial_of(motor), number, motor.body.index, motor.particles.tolist()),
                *(motor._drive.turns, motor._drive.is_fixed, motor._drive.axis.tolist()),
                None if motor._drive.point is None else motor._drive.point.tolist(),
                *(motor.speed, motor.limit),
            ]
            for number, motor in sorted(self.by_number.items())
        ]

    def row_counts(self, entries: list[list[Any]]) -> dict[str, int]:
        """See `Slice.row_counts`. All rows up to the last motor in use are counted."""
        return {USED_MOTORS: max((int(number) for _, number, *_ in entries), default=-1) + 1}

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, int, int, NDArray[np.int32], Drive]]:
        """See `Slice.read`. Raises: ValueError for a missing body or invalid settings."""
        found = []
        for serial, number, slot, particles, turns, is_fixed, axis, point, speed, limit in entries:
            count = vertex_counts[below(slot, len(vertex_counts))]
            if not (count and self.context.built.program.has_contact):
                raise ValueError("a motor has no body")
            drive = Drive(
                as_flag(turns, "turns"),
                as_flag(is_fixed, "is_fixed"),
                vector_of(axis, 3, 1.001),
                None if point is None else vector_of(point, 3),
                _as_speed(speed, turns),
                _as_limit(limit, "limit"),
            )
            driven = indices_below(particles, count)
            found.append((int(serial), below(number, MOST_MOTORS), int(slot), driven, drive))
        is_twice = len({number for _, number, *_ in found}) < len(found)
        if is_twice or sum(len(driven) for *_, driven, _ in found) > MOTOR_ROWS:
            raise ValueError("it has more motors than a world can have")
        return found

    def restore(self, read: Any) -> None:
        """Replace all motors by the motors from `read`."""
        had_any = bool(self.by_number)
        self.by_number.clear()
        for serial, number, slot, particles, drive in read:
            body = self.context.slots.slots[slot]
            assert body is not None
            motor = self.context.handles.find(serial, Motor) or Motor(body, number, particles, drive)
            self.context.handles.enlist(motor, serial)
            motor.body, motor.particles, motor._number, motor._drive = body, particles, number, drive
            self.by_number[number] = motor
        if had_any or self.by_number:
            write_motors(self.context.built.state, *self.rows())

    def add(
        self,
        body: SoftBody,
        particles: ArrayLike,
        axis: ArrayLike,
        speed: float,
        max_torque: float | None,
        max_force: float | None,
        is_fixed: bool,
        point: ArrayLike | None,
    ) -> Motor:
        """Implement `World.add_motor` for a body of this world."""
        context = self.context
        vertices = named_particles(body, particles)
        if (max_torque is None) == (max_force is None):
            raise OptionError(
                "a motor turns with max_torque [N m] or pushes with max_force [N]: give one of the two, got "
                f"max_torque={max_torque!r}, max_force={max_force!r}"
            )
        turns = max_torque is not None
        limit = _as_limit(max_torque if turns else max_force, "max_torque" if turns else "max_force")
        wanted, stays = _as_speed(speed, turns), as_flag(is_fixed, "is_fixed")
        direction = as_vector(axis, "axis", "")
        length = length_of(direction)
        if not length > 0.0:
            raise OptionError(f"axis must have a length above 0, got {direction.tolist()}")
        if point is not None and not (turns and stays):
            raise OptionError(
                "point is only for a rotation about a fixed axis: give max_torque and is_fixed=True too, or "
                "leave out point"
            )
        place = None if point is None else as_vector(point, "point", "m")
        require_per_body(context, "motors")
        drive = Drive(turns, stays, direction / length, place, wanted, limit)
        if not stays:
            drive.axis = _rest_axis(body, vertices, drive.axis)
        free = self.free_number()
        used = self.rows_in_use
        if used + len(vertices) > MOTOR_ROWS:
            raise StateError(
                f"the motors of a world have at most {MOTOR_ROWS} particles: {used} are in use, and "
                f"{len(vertices)} more were requested. Remove a motor, or give fewer"
            )
        change(body, forget_impulse, free)
        motor = self.by_number[free] = Motor(body, free, vertices, drive)
        change(body, write_motors, *self.rows())
        handles_of(body).enlist(motor)
        return motor


def _as_speed(speed: Any, turns: bool) -> float:
    unit = "rad/s" if turns else "m/s"
    return as_number(
        speed, "speed", -VELOCITY_LIMIT, VELOCITY_LIMIT, f"a number up to {VELOCITY_LIMIT:g} {unit}"
    )


def _as_limit(limit: Any, name: str) -> float:
    return as_number(limit, name, 0.0, LARGEST_LIMIT, f"a number from 0 to {LARGEST_LIMIT:g}")


def _rest_axis(body: SoftBody, vertices: NDArray[np.int32], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform an axis from the current shape of the driven particles to their rest shape.

    Returns: direction of the axis, (3,).
    Raises: OptionError if the particles lie on a line, because their rotation about the line is undefined.
    """
    rest, now = body.mesh.vertices[vertices], body.positions()[vertices].astype(np.float64)
    found = np.empty(4)
    weights = body.masses[vertices] / mass_of(body, vertices)
    find_rest_axis(rest, now, weights, axis, found)
    if not found[3] > THINNEST:
        raise OptionError(
            "particles are on a line, so an axis cannot rotate with them: give more, or set is_fixed=True"
        )
    return found[:3]
