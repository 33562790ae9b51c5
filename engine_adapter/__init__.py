"""Interface for game loops: fixed steps at any frame rate, and interpolated positions."""

from typing import TYPE_CHECKING

from engine_adapter.adapter import EngineAdapter
from engine_adapter.budget import BudgetStatus
from engine_adapter.fixed_step import FixedStep
from engine_adapter.rollback import Rollback
from engine_adapter.session import RollbackSession, SessionError
from taichi_soft.core.renamed import warn_renamed

__all__ = ["BudgetStatus", "EngineAdapter", "FixedStep", "Rollback", "RollbackSession", "SessionError"]

if not TYPE_CHECKING:

    def __getattr__(name):
        """Return `BudgetStatus` for its deprecated name `GivenUp`."""
        if name != "GivenUp":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        warn_renamed("engine_adapter.GivenUp", "engine_adapter.BudgetStatus")
        return BudgetStatus
