"""The state of a world, taken and put back, and its recording."""

from __future__ import annotations

from pathlib import Path

from taichi_soft.core.errors import StateError
from taichi_soft.persistence.snapshot import bodies_hash, restore_snapshot, state_hash, take_snapshot
from taichi_soft.world.world_parts import WorldParts


class WorldStates(WorldParts):
    """What of a world keeps its states."""

    def snapshot(self) -> bytes:
        """The whole state between two steps, to `restore` it here or in a world that was built alike.

        Bodies, colliders, frames, grabs, attachments and joints, gravity, the wind, materials and frictions
        that were set, and all that is going to act in the coming step are in it; a force field is not. Of the
        events recorded it has what goes on, such as contacts. It holds numbers only, no code. The first call
        compiles, some seconds at most.
        Raises: StateError before `build`.
        Example:
            before = world.snapshot()  # bytes: keep them in a file, or send them
            world.step(1 / 60)
            world.restore(before)
        """
        data = take_snapshot(self._context)
        if self._recorder is not None:
            self._recorder.record_snapshot(data)
        return data

    def restore(self, data: bytes) -> None:
        """Go back to a state of `snapshot`: what follows is the same, bit for bit, given the same calls.

        Handles of what the state has stay valid, or become so again; handles of what it has not are dead, as
        if that had been removed. For what it has and nobody holds a handle to, `bodies` and `colliders` have
        new ones. A force field stays as it is. Those who listen to events go on to; watched stress is as it
        was, and what else is watched now stays so. Events of undone steps that wait are dropped: when the
        steps are made again, they come again, and so do those that were drained before.
        Args:
            data: made by `snapshot`, of this world or one that was built of the same things.
        Raises: SnapshotError for what is damaged, or of a world that was built of other things, with the
            first that differs; OptionError for what is not bytes; StateError before `build`.
        """
        restore_snapshot(self._context, data)
        self._restore_count += 1
        if self._recorder is not None:
            self._recorder.rewind(self._context, data)

    @property
    def restore_count(self) -> int:
        """How often `restore` was called: whoever keeps earlier states sees that they are of another past."""
        return self._restore_count

    def state_hash(self) -> str:
        """A name of the state, 16 hexadecimal digits: the same in two worlds that are in step.

        Made of step count, gravity, positions, velocities, pins, who lives, sleeps or is frozen, colliders,
        frames, grabs and joints; the same for any number of threads.
        Raises: StateError before `build`.
        """
        return state_hash(self._context)

    def bodies_hash(self) -> str:
        """Hash of the state of all bodies, 16 hexadecimal digits: the same as in the exported world.

        There it is `ts_world_hash` in C and `world.hash()` in JavaScript. It covers positions, velocities,
        pins, and who is asleep or frozen. `state_hash`, which exported worlds do not have, covers step count,
        gravity, colliders, frames, grabs and joints too.
        Raises: StateError before `build`.
        """
        return bodies_hash(self._context)

    def save_recording(self, path: str | Path) -> Path:
        """Write what was done in the last `record` steps or more, and the snapshot before them, to a file.

        Steps that `restore` has undone are not in it, and do not count; where it went to a state that was
        not kept here, the recording begins again there.
        `taichi-soft replay FILE` makes it again anywhere, bit by bit on a machine like this one. The file
        holds the assets and shapes as well, and the accelerations that a force field gave, but no code.
        Args:
            path: of the file to write.
        Returns: the path.
        Raises: StateError without `record` or before `build`; SnapshotError where the file cannot be written.
        """
        _ = self._built
        if self._recorder is None:
            raise StateError("this world records nothing: make it with World(record=240)")
        return self._recorder.save(self._context, path)
