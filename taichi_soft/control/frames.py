"""Frames of the engine that bodies hang from, and the call that aims all pinned particles before a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.soft_body import Context, RowsOf, Slice, SoftBody
from taichi_soft.control.kernels.pins import WITH_FRAME, aim_pinned
from taichi_soft.control.rigid_transform import carry
from taichi_soft.core.checks import as_flag, as_rotation, as_vector
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, recorded, serial_of
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.serialisation import require_below, vector_of


class Frames(Slice):
    """Poses of all frames of one world: rotation row by row, and position [m], (f, 12)."""

    name = "frames"

    def __init__(self, context: Context) -> None:
        """None yet; one row, as a kernel takes no empty array."""
        super().__init__(context)
        self.attachments: dict[SoftBody, list[Any]] = {}  # by the body that they hold, in their order
        self.rows: list[Frame | None] = []  # None where one was removed: the next frame takes the first such
        self.present = np.zeros((1, 12), dtype=np.float32)
        self.coming = self.present.copy()  # at the end of the coming step
        self.past = self.present.copy()  # before the last step
        self.has_work = False  # some pinned particle has somewhere to go, or has just arrived

    @property
    def handles(self) -> list[Frame]:
        """Those that are alive, by row."""
        return [frame for frame in self.rows if frame is not None]

    def add(self, frame: Frame, pose: NDArray[np.float32]) -> int:
        """The row of a new frame."""
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
        """The row of a frame. Raises: OptionError for what is no frame of this world; StateError if it was
        removed."""
        if not isinstance(frame, Frame) or frame._frames is not self:
            raise OptionError(f"frame must come from add_frame of the same world, got {frame!r}")
        frame._require_alive()
        return frame._number

    def holding(self, body: SoftBody) -> list[Any]:
        """The attachments that hold a body."""
        return self.attachments.get(body, [])

    def hanging(self, frame: Frame) -> list[Any]:
        """The attachments to a frame, body by body."""
        bodies = sorted(self.attachments, key=lambda body: body.index)
        return [each for body in bodies for each in self.attachments[body] if each.frame is frame]

    def aim(self, state: BodyFields, body_count: int, dt: float) -> None:
        """Give pinned particles the velocities of the coming step."""
        if self.has_work:
            self.has_work = aim_pinned(state, body_count, dt, self.coming) > 0
        self.past, self.present = self.present, self.coming.copy()

    def way(self, body: SoftBody) -> float:
        """How far frames moved a particle of a body in the last step, which was undone for it [m]."""
        x, longest = body.positions().astype(np.float64), 0.0
        for each in self.holding(body):
            (a, start), (b, end) = (
                _axes_and_place(poses[each.frame._number]) for poses in (self.past, self.present)
            )
            moved = (x[each.particles] - start) @ a @ b.T + end
            longest = max(longest, float(np.linalg.norm(moved - x[each.particles], axis=1).max()))
        return longest

    def entries(self) -> list[list[Any]]:
        """Of each row the number of its handle, 0 where it is free, and both poses."""
        return [
            [0 if frame is None else serial_of(frame), present.tolist(), coming.tolist()]
            for frame, present, coming in zip(self.rows, self.present, self.coming, strict=False)
        ]

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """Of those rows that are not free."""
        return [serial for serial, _, _ in entries if serial != 0]

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, NDArray[np.float32], NDArray[np.float32]]]:
        """Rows of `entries`. Raises: ValueError for one out of reach."""
        found = []
        for serial, *poses in entries:
            present, coming = (vector_of(pose, 12) for pose in poses)
            if not max(np.abs(present).max(), np.abs(coming).max()) <= POSITION_LIMIT:
                raise ValueError("a frame is out of reach")
            found.append((int(serial), present.astype(np.float32), coming.astype(np.float32)))
        return found

    def require(self, read: Any, rows_of: RowsOf) -> None:
        """Raises: ValueError where a particle goes with a frame that there never was."""
        require_below(rows_of(self.context.built.state.particle_aim), WITH_FRAME + len(read))

    def restore(self, read: Any) -> None:
        """Let there be the frames that were `read`, and no other. Pins are aimed before the next step."""
        self.rows = [None] * len(read)
        self.present = np.zeros((max(len(read), 1), 12), dtype=np.float32)
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
    """A place that moves as the engine says: a bone, a vehicle, a hand. Made by `World.add_frame`."""

    def __init__(self, frames: Frames, position: ArrayLike, rotation: Any) -> None:
        """Made by `World.add_frame`."""
        self._frames = frames
        self._number = frames.add(self, _pose(position, rotation))

    @classmethod
    def _at(cls, frames: Frames, number: int) -> Frame:
        """A handle to a frame that there is."""
        frame = cls.__new__(cls)
        frame._frames, frame._number = frames, number
        return frame

    def __repr__(self) -> str:
        if not self.is_alive:
            return f"Frame({self._number}, removed)"
        return f"Frame({self._number}, position={self.position.round(3).tolist()})"

    @property
    def is_alive(self) -> bool:
        """False once it was removed, or the world put back to a state without it."""
        rows = self._frames.rows
        return self._number < len(rows) and rows[self._number] is self

    def _require_alive(self) -> None:
        if not self.is_alive:
            raise StateError(
                f"frame {self._number} was removed, or is not in the state that was restored: add another"
            )

    @property
    def position(self) -> NDArray[np.float32]:
        """Where its origin is after the last step, (3,) [m]."""
        self._require_alive()
        return np.array(self._frames.present[self._number, 9:])

    @property
    def rotation(self) -> NDArray[np.float32]:
        """Its axes after the last step, as columns, (3, 3)."""
        self._require_alive()
        return np.array(self._frames.present[self._number, :9].reshape(3, 3))

    @recorded
    def move_to(self, position: ArrayLike, rotation: ArrayLike | None = None) -> None:
        """Say where it is at the end of the coming step; it stays there until it is moved again.

        What hangs from it is dragged along, and breaks where that is farther in a step than it is large: a
        jump is one of `teleport`.
        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps its axes as they are.
        Raises: OptionError for bad numbers.
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
        """Be there at once, with the whole of every body attached to it, by the same rigid motion.

        Pictures between two steps jump with them, and so do targets that were set for their pins. Bodies that
        are joined to them, and grabs, stay where they are. A `move_to` that was said before is forgotten.
        What then lies below the floor or in a collider is pressed out, and breaks where that is far.
        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w); None keeps its axes as they are.
            keep_velocity: True turns velocities with the bodies, False stops them.
        Raises: OptionError for bad numbers or where a body would be out of reach; StateError for a body that
            hangs from another frame as well.
        """
        self._require_alive()
        frames, keep = self._frames, as_flag(keep_velocity, "keep_velocity")
        pose, present = _pose(position, rotation), frames.present[self._number].copy()
        if rotation is None:
            pose[:9] = present[:9]
        bodies = list(dict.fromkeys(each.body for each in frames.hanging(self)))
        for body in bodies:
            if any(each.frame is not self for each in frames.holding(body)):
                raise StateError(
                    f"body {body.index} hangs from another frame as well: release it there before this jumps"
                )
        (axes, start), (pose_axes, end) = _axes_and_place(present), _axes_and_place(pose)
        turn = np.eye(3) if rotation is None else turned(pose_axes, axes)
        carry(bodies, turn, start, end, keep=keep)
        frames.present[self._number] = frames.coming[self._number] = pose

    @recorded
    def remove(self) -> None:
        """Take it out of the world; what is attached to it is released, with the velocity that it had."""
        self._require_alive()
        for attachment in self._frames.hanging(self):
            attachment.release()
        self._frames.rows[self._number] = None


def _axes_and_place(pose: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Axes as columns (3, 3), and origin (3,) [m]."""
    return pose[:9].reshape(3, 3).astype(np.float64), pose[9:].astype(np.float64)


def _pose(position: ArrayLike, rotation: Any) -> NDArray[np.float32]:
    place = as_vector(position, "position", "m")
    return np.concatenate([as_rotation(rotation).ravel(), place]).astype(np.float32)
