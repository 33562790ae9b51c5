"""Go back a few steps and repeat them with inputs that arrived late."""

from __future__ import annotations

from taichi_soft import OptionError, StateError, World
from taichi_soft.core.checks import as_count


class Rollback:
    """Snapshots of the last steps of a world.

    If other code calls `World.restore`, for example to load a game, the snapshots no longer lead to the
    current state. `steps` is then empty, and the next `save` starts a new history.

    Args:
        world: a built world.
        ticks: number of steps to store, 1 or more. Each step takes the memory of a snapshot.
    Raises: OptionError for wrong arguments; StateError if the world is not built.
    Example:
        rollback = Rollback(world, ticks=30)
        for tick in range(10):
            rollback.save()
            world.step(1 / 60, substeps=8)
        rollback.rewind_to(rollback.steps[4])  # an input of that tick arrived late
    """

    def __init__(self, world: World, ticks: int) -> None:
        if not isinstance(world, World):
            raise OptionError(f"world must be a taichi_soft.World, got {type(world).__name__}")
        if not world.is_built:
            raise StateError("the world is not built: call world.build() before Rollback(world, ticks)")
        self._world = world
        self._ticks = as_count(ticks, "ticks")
        self._snapshots: dict[int, bytes] = {}  # snapshots by step count, ascending
        self._restore_count = world.restore_count  # value at the time of the snapshots

    @property
    def steps(self) -> tuple[int, ...]:
        """Step counts that `rewind_to` can restore, in ascending order."""
        return tuple(self._snapshots) if self._is_past else ()

    @property
    def _is_past(self) -> bool:
        """True if the snapshots lead to the current state, because no other code has restored the world."""
        return self._restore_count == self._world.restore_count

    def save(self) -> None:
        """Store the current state. Call this between a step and the inputs of the next step."""
        if not self._is_past:
            self._snapshots.clear()
            self._restore_count = self._world.restore_count
        now = self._world.step_count
        self._snapshots.pop(now, None)
        self._snapshots[now] = self._world.snapshot()
        while len(self._snapshots) > self._ticks + 1:  # the newest snapshot is the current state
            del self._snapshots[next(iter(self._snapshots))]

    def rewind_to(self, step: int) -> None:
        """Restore the state that `save` stored at a step count, and drop later states.

        Args:
            step: one of `steps`.
        Raises: OptionError for a step that is not in `steps`, with nothing changed.
        """
        wanted = as_count(step, "step", 0)
        if not self._is_past:
            raise OptionError(
                f"step {wanted} is not stored: the world was restored to another state since. "
                "Rewind after the next save"
            )
        if wanted not in self._snapshots:
            kept = f"{self.steps[0]} to {self.steps[-1]}" if self._snapshots else "none yet"
            raise OptionError(f"step {wanted} is not stored (stored: {kept}): use more ticks, or rewind less")
        self._world.restore(self._snapshots[wanted])
        self._restore_count = self._world.restore_count
        for later in [each for each in self._snapshots if each > wanted]:
            del self._snapshots[later]
