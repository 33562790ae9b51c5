"""What a game loop talks to: fixed steps from frames of any length, and positions in between."""

from engine_adapter.adapter import EngineAdapter
from engine_adapter.budget import GivenUp
from engine_adapter.fixed_step import FixedStep
from engine_adapter.rollback import Rollback
from engine_adapter.session import RollbackSession, SessionError

__all__ = ["EngineAdapter", "FixedStep", "GivenUp", "Rollback", "RollbackSession", "SessionError"]
