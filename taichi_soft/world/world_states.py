"""Methods of a world for snapshots, hashes and recordings."""

from __future__ import annotations

from pathlib import Path

from taichi_soft.core.errors import StateError
from taichi_soft.persistence.snapshot import bodies_hash, restore_snapshot, state_hash, take_snapshot
from taichi_soft.world.world_parts import WorldParts


class WorldStates(WorldParts):
    """Methods of a world that save, restore and compare states."""

    def snapshot(self) -> bytes:
        """Return the complete state between two steps, for `restore` in this world or an identical world.

        The snapshot contains bodies, colliders, frames, grabs, attachments and joints, gravity, wind, changed
        materials and frictions, all forces of the next step, and current contacts if their events are
        recorded, but no force field. The snapshot contains no code. The first call compiles kernels for a few
        seconds at most.
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
        """Restore a state that `snapshot` returned. The same calls then give bit-identical steps.

        Handles of objects in the state stay valid, or become valid again; other handles become invalid, as
        after a removal. `bodies` and `colliders` provide new handles for objects without a valid handle. The
        force field and listeners do not change. Bodies whose stress was watched in that state are watched
        again, and bodies that are watched now stay watched. Waiting events of undone steps are dropped.
        Repeating the steps records these events again, even those that were drained before.
        Args:
            data: result of `snapshot`, from this world or a world that was built in the same way.
        Raises: SnapshotError for damaged data, or for a world that was built differently, with the first
            difference; OptionError for data that is not bytes; StateError before `build`.
        """
        restore_snapshot(self._context, data)
        self._restore_count += 1
        if self._recorder is not None:
            self._recorder.rewind(self._context, data)

    @property
    def restore_count(self) -> int:
        """Number of `restore` calls.

        If this number has changed, states that you stored before can belong to undone steps.
        """
        return self._restore_count

    def state_hash(self) -> str:
        """Return a hash of the state, 16 hexadecimal digits. Two synchronised worlds have the same hash.

        The hash covers step count, gravity, positions, velocities, pins, the status of bodies, colliders,
        frames, grabs and joints. The hash does not depend on the number of threads.
        Raises: StateError before `build`.
        """
        return state_hash(self._context)

    def bodies_hash(self) -> str:
        """Return a hash of the state of all bodies, 16 hexadecimal digits. An exported world has the same
        hash.

        In an exported world, call `ts_world_hash` in C and `world.hash()` in JavaScript. The hash covers
        positions, velocities, pins, and the status of bodies. `state_hash`, which exported worlds do not
        have, also covers step count, gravity, colliders, frames, grabs and joints.
        Raises: StateError before `build`.
        """
        return bodies_hash(self._context)

    def save_recording(self, path: str | Path) -> Path:
        """Write a recording of at least the last `record` steps to a file.

        A recording contains the snapshot before these steps, and all calls. It excludes steps that `restore`
        has undone. After a `restore` of a state that the recorder does not store, the recording starts again
        from that state. `taichi-soft replay FILE` repeats the steps on any machine. On the same kind of
        machine, the results are identical bit for bit. The file also contains the assets and shapes, and the
        accelerations of a force field, but no code.
        Args:
            path: path of the file.
        Returns: the path.
        Raises: StateError without `record` or before `build`; SnapshotError if the file cannot be written.
        """
        _ = self._built
        if self._recorder is None:
            raise StateError("this world has no recorder: make it with World(record=240)")
        return self._recorder.save(self._context, path)
