"""Frames to which bodies are attached, and the velocities of all pinned particles in the next step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.soft_body import Context, Slice, SoftBody
from taichi_soft.control.kernels.pins import FRAME_WIDTH, aim_pinned
from taichi_soft.control.rigid_transform import carry
from taichi_soft.core.checks import as_flag, as_rotation, as_vector
from taichi_soft.core.constants import NEAR, POSITION_LIMIT
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.field_table import FRAME
from taichi_soft.core.handles import Handle, recorded, serial_of
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.residue import rounding_error
from taichi_soft.core.serialisation import vector_of

NO_ERROR = [0.0, 0.0, 0.0]
"""Rounding error of a frame near the origin."""


class Frames(Slice):
    """All frames of one world, with their poses, (f, `FRAME_WIDTH`)."""

    name = "frames"

    def __init__(self, context: Context) -> None:
        """Start without frames, but with one row of poses, because kernels do not accept empty arrays."""
        super().__init__(context)
        self.attachments: dict[SoftBody, list[Any]] = {}  # attachments of each body, in order of creation
        self.rows: list[Frame | None] = []  # frame in each row, None if the row is free
        self.present = np.zeros((1, FRAME_WIDTH), dtype=np.float32)
        self.coming = self.present.copy()  # poses at the end of the next step
        self.past = self.present.copy()  # poses before the last step
        self.has_work = False  # True if a pinned particle has a target or has just reached it

    @property
    def handles(self) -> list[Frame]:
        """All frames, in the order of their rows."""
        return [frame for frame in self.rows if frame is not None]

    def add(self, frame: Frame, pose: NDArray[np.float32]) -> int:
        """Add a frame with its pose. Return its row."""
        number = self.rows.index(None) if None in self.rows else len(self.rows)
        if number == len(self.rows):
            self.rows.append(frame)
            self.present, self.coming = (
                np.concatenate([poses[:number], pose[None]]) for poses in (self.present, self.coming)
            )
        self.rows[number] = frame
        self.present[number] = self.coming[number] = pose
        return number

    def number_of(self, frame: Any) -> int:
        """Return the row of a frame.

        Raises: OptionError for a frame of another world; StateError if the frame was removed.
        """
        if not isinstance(frame, Frame) or frame._frames is not self:
            raise OptionError(f"frame must come from add_frame of the same world, got {frame!r}")
        frame._require_alive()
        return frame._number

    def holding(self, body: SoftBody) -> list[Any]:
        """Return the attachments of a body."""
        return self.attachments.get(body, [])

    def attachments_to(self, frame: Frame) -> list[Any]:
        """Return the attachments to a frame, in the order of their bodies' slots."""
        bodies = sorted(self.attachments, key=lambda body: body.index)
        return [each for body in bodies for each in self.attachments[body] if each.frame is frame]

    def aim(self, state: BodyFields, body_count: int, dt: float) -> None:
        """Set the velocities of pinned particles for the next step of `dt` [s]."""
        if self.has_work:
            self.has_work = aim_pinned(state, body_count, dt, np.concatenate([self.coming, self.present])) > 0
        self.past, self.present = self.present, self.coming.copy()

    def displacement(self, body: SoftBody) -> float:
        """Return the largest distance by which frames moved a particle of a body in the last step [m].

        Call this method after the last step was undone.
        """
        x, longest = body.exact_positions(), 0.0
        for each in self.holding(body):
            (a, start), (b, end) = (
                _axes_and_place(poses[each.frame._number]) for poses in (self.past, self.present)
            )
            moved = (x[each.particles] - start) @ a @ b.T + end
            longest = max(longest, float(np.linalg.norm(moved - x[each.particles], axis=1).max()))
        return longest

    def shift_origin(self, offset: NDArray[np.float64]) -> None:
        """See `Slice.shift_origin`."""
        for poses in (self.past, self.present, self.coming):
            poses[:, 9:] = _split(_place(poses) - offset)

    def entries(self) -> list[list[Any]]:
        """List each row's serial number (0 if the row is free), current pose and next pose."""
        return [
            [0 if frame is None else serial_of(frame), _numbers(present), _numbers(coming)]
            for frame, present, coming in zip(self.rows, self.present, self.coming, strict=False)
        ]

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """Return the serial numbers of the rows in use."""
        return [serial for serial, _, _ in entries if serial != 0]

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, NDArray[np.float32], NDArray[np.float32]]]:
        """See `Slice.read`. Raises: ValueError for a pose out of range."""
        found = []
        for serial, *poses in entries:
            rows = (pose if len(pose) == FRAME_WIDTH else [*pose, *NO_ERROR] for pose in poses)
            present, coming = (vector_of(row, FRAME_WIDTH) for row in rows)
            if not max(np.abs(present).max(), np.abs(coming).max()) <= POSITION_LIMIT:
                raise ValueError("a frame is out of range")
            found.append((int(serial), present.astype(np.float32), coming.astype(np.float32)))
        return found

    def things(self, read: Any) -> dict[str, int]:
        """Return the number of rows of frames: see `Slice.things`."""
        return {FRAME: len(read)}

    def restore(self, read: Any) -> None:
        """Replace all frames by the frames from `read`. Pins get their velocities before the next step."""
        self.rows = [None] * len(read)
        self.present = np.zeros((max(len(read), 1), FRAME_WIDTH), dtype=np.float32)
        self.coming = self.present.copy()
        self.past, self.has_work = self.present.copy(), True
        handles = self.context.handles
        for row, (serial, present, coming) in enumerate(read):
            self.present[row], self.coming[row] = present, coming
            if serial == 0:
                continue
            frame = handles.find(serial, Frame)
            if frame is None or frame._number != row:
                frame = Frame._at(self, row)
            handles.enlist(frame, serial)
            self.rows[row] = frame


class Frame(Handle):
    """A pose that the game moves, such as a bone, a vehicle or a hand. Returned by `World.add_frame`."""

    def __init__(self, frames: Frames, position: ArrayLike, rotation: Any) -> None:
        """Use `World.add_frame` instead."""
        self._frames = frames
        self._number = frames.add(self, _pose(position, rotation))

    @classmethod
    def _at(cls, frames: Frames, number: int) -> Frame:
        """Make a handle for the frame in row `number`."""
        frame = cls.__new__(cls)
        frame._frames, frame._number = frames, number
        return frame

    def __repr__(self) -> str:
        if not self.is_alive:
            return f"Frame({self._number}, removed)"
        return f"Frame({self._number}, position={self.position.round(3).tolist()})"

    @property
    def is_alive(self) -> bool:
        """True until the frame is removed, or the world is restored to a state without it."""
        rows = self._frames.rows
        return self._number < len(rows) and rows[self._number] is self

    def _require_alive(self) -> None:
        if not self.is_alive:
            raise StateError(
                f"frame {self._number} was removed, or is not in the state that was restored: add another"
            )

    @property
    def position(self) -> NDArray[np.float32]:
        """Position of the frame's origin after the last step, (3,) [m]."""
        self._require_alive()
        return np.array(self._frames.present[self._number, 9:12])

    @property
    def _exact_position(self) -> NDArray[np.float64]:
        return _place(self._frames.present[self._number])

    @property
    def rotation(self) -> NDArray[np.float32]:
        """Rotation matrix of the frame after the last step, with its axes as columns, (3, 3)."""
        self._require_alive()
        return np.array(self._frames.present[self._number, :9].reshape(3, 3))

    @recorded
    def move_to(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Move the frame to a pose during the next step. It stays there until it is moved again.

        The frame drags the attached bodies along. A body that is dragged farther than its size in one step
        fails: use `teleport` for jumps.
        Args:
            position: new position of the origin, (3,) [m].
            rotation: new rotation, as a matrix (3, 3) or quaternion (x, y, z, w); None: unchanged.
        Raises: OptionError for invalid numbers.
        """
        self._require_alive()
        axes = self._frames.coming[self._number, :9].copy()
        pose = _pose(position, rotation)
        if rotation is None:
            pose[:9] = axes
        self._frames.coming[self._number] = pose

    @recorded
    def teleport(
        self, position: ArrayLike, rotation: ArrayLike | None = None, *, keep_velocity: bool = True
    ) -> None:
        """Jump to a pose, and move every attached body as a whole by the same rigid motion.

        The previous positions for interpolation and the targets of pins jump too. Bodies joined to the
        attached bodies do not move. Targets of grabs do not move either. An earlier `move_to` is discarded.
        Parts that are then below the floor or inside a collider are pushed out. A body fails if its parts are
        pushed far.
        Args:
            position: new position of the origin, (3,) [m].
            rotation: new rotation, as a matrix (3, 3) or quaternion (x, y, z, w); None: unchanged.
            keep_velocity: True rotates velocities with the bodies, False stops them.
        Raises: OptionError for invalid numbers or a body that would be out of range; StateError for a body
            that is also attached to another frame.
        """
        self._require_alive()
        frames, keep = self._frames, as_flag(keep_velocity, "keep_velocity")
        pose, present = _pose(position, rotation), frames.present[self._number].copy()
        if rotation is None:
            pose[:9] = present[:9]
        bodies = list(dict.fromkeys(each.body for each in frames.attachments_to(self)))
        for body in bodies:
            if any(each.frame is not self for each in frames.holding(body)):
                raise StateError(
                    f"body {body.index} is also attached to another frame: release it there first"
                )
        (axes, start), (pose_axes, end) = _axes_and_place(present), _axes_and_place(pose)
        turn = np.eye(3) if rotation is None else turned(pose_axes, axes)
        carry(bodies, turn, start, end, keep=keep)
        frames.present[self._number] = frames.coming[self._number] = pose

    @recorded
    def remove(self) -> None:
        """Remove the frame from the world and release its attachments. The particles keep their velocity."""
        self._require_alive()
        for attachment in self._frames.attachments_to(self):
            attachment.release()
        self._frames.rows[self._number] = None


def exact_position_of(frame: Frame) -> NDArray[np.float64]:
    """Return the position of a frame's origin in float64, (3,) [m]."""
    return frame._exact_position


def _axes_and_place(pose: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Split a pose into axes as columns (3, 3), and origin (3,) [m]."""
    return pose[:9].reshape(3, 3).astype(np.float64), _place(pose)


def _numbers(pose: NDArray[np.float32]) -> list[float]:
    """Return a pose as plain numbers. Rounding errors of zero are omitted."""
    found: list[float] = pose.tolist()
    return found[: -len(NO_ERROR)] if found[-len(NO_ERROR) :] == NO_ERROR else found


def _place(poses: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the positions of poses in float64, (..., 3) [m]."""
    return np.asarray(poses[..., 9:12].astype(np.float64) + poses[..., 12:])


def _split(place: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return positions and their rounding errors, (..., 6) [m]. Errors near the origin are omitted."""
    errors = np.where(np.abs(place) > NEAR, rounding_error(place), 0.0)
    return np.concatenate([place, errors], axis=-1).astype(np.float32)


def _pose(position: ArrayLike, rotation: Any) -> NDArray[np.float32]:
    place = as_vector(position, "position", "m")
    return np.concatenate([as_rotation(rotation).ravel().astype(np.float32), _split(place)])
