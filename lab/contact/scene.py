"""A scene of contact: a world, and the criteria that its motion must meet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lab.contact.criteria import Criterion
from taichi_soft import World


@dataclass(frozen=True)
class Stage:
    """A world at the start of a scene."""

    world: World
    criteria: tuple[Criterion, ...]
    before_step: Callable[[float], None] | None = None  # called with the time before each step [s]


@dataclass(frozen=True)
class Scene:
    """A scene of contact."""

    name: str
    title: str  # what happens, in a sentence
    seconds: float  # simulated time
    make: Callable[[], Stage]
