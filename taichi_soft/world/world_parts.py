"""What all parts of a world's public face have in common."""

from __future__ import annotations

from taichi_soft.core.handles import Handle
from taichi_soft.persistence.recorder import Recorder
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.simulation import Simulation


class WorldParts(Handle):
    """A world, as each of the classes that `World` is made of sees it."""

    _context: WorldContext
    _recorder: Recorder | None
    _restore_count: int

    @property
    def _built(self) -> Simulation:
        """Raises: StateError before `build`."""
        return self._context.built
