"""Base class of all parts of `World`."""

from __future__ import annotations

from taichi_soft.core.handles import Handle
from taichi_soft.persistence.recorder import Recorder
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.simulation import Simulation


class WorldParts(Handle):
    """Base class of the classes from which `World` inherits."""

    _context: WorldContext
    _recorder: Recorder | None
    _restore_count: int

    @property
    def _built(self) -> Simulation:
        """The simulation of the built world. Raises: StateError before `build`."""
        return self._context.built
