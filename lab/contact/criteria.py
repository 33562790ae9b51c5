"""Criteria of contact scenes: what is measured in each step, and which result is required."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lab.contact.geometry import overlap
from taichi_soft import Body

Floats = NDArray[np.float64]


class Criterion(ABC):
    """A quantity that is measured in a scene, and its required value."""

    name: str
    wanted: str

    @abstractmethod
    def measure(self, time: float) -> None:
        """Measure after a step, `time` [s] after the start."""

    @abstractmethod
    def result(self) -> tuple[str, bool]:
        """Return the measured value in words, and whether it is as required."""


@dataclass
class Most(Criterion):
    """The largest value of a function during the scene must not exceed a limit."""

    name: str
    function: Callable[[], float]
    limit: float
    unit: str
    after: float = 0.0  # time at which the measurement begins [s]
    every: int = 1  # number of steps between measurements
    largest: float = -np.inf
    count: int = 0

    @property
    def wanted(self) -> str:  # type: ignore[override]
        """The limit in words."""
        return f"at most {self.limit:g} {self.unit}".strip()

    def measure(self, time: float) -> None:
        """Update the largest value."""
        self.count += 1
        if time >= self.after and self.count % self.every == 0:
            value = self.function()
            self.largest = max(self.largest, value if np.isfinite(value) else np.inf)

    def result(self) -> tuple[str, bool]:
        """Return the largest value, and whether it is within the limit."""
        return f"{self.largest:.3g} {self.unit}".strip(), self.largest <= self.limit


@dataclass
class Finally(Criterion):
    """The value of a function at the end of the scene must be in an interval."""

    name: str
    function: Callable[[], float]
    lowest: float
    highest: float
    unit: str

    @property
    def wanted(self) -> str:  # type: ignore[override]
        """The interval in words."""
        if self.highest == np.inf:
            return f"at least {self.lowest:g} {self.unit}".strip()
        if self.lowest == -np.inf:
            return f"at most {self.highest:g} {self.unit}".strip()
        return f"{self.lowest:g} to {self.highest:g} {self.unit}".strip()

    def measure(self, time: float) -> None:
        """Measure nothing before the end."""

    def result(self) -> tuple[str, bool]:
        """Return the value at the end, and whether it is in the interval."""
        value = self.function()
        return f"{value:.3g} {self.unit}".strip(), bool(self.lowest <= value <= self.highest)


@dataclass
class AtRest(Criterion):
    """All bodies must fall asleep within a time, and stay where they are."""

    bodies: Sequence[Body]
    within: float  # [s]
    name: str = "asleep after"
    asleep_since: float | None = None

    @property
    def wanted(self) -> str:  # type: ignore[override]
        """The time in words."""
        return f"at most {self.within:g} s"

    def measure(self, time: float) -> None:
        """Store the time at which the last body fell asleep."""
        if not all(body.is_asleep for body in self.bodies):
            self.asleep_since = None
        elif self.asleep_since is None:
            self.asleep_since = time

    def result(self) -> tuple[str, bool]:
        """Return the time at which the last body fell asleep, and whether this was early enough."""
        if self.asleep_since is None:
            awake = sum(not body.is_asleep for body in self.bodies)
            return f"{awake} of {len(self.bodies)} awake at the end", False
        return f"{self.asleep_since:.1f} s", self.asleep_since <= self.within


@dataclass
class Creep(Criterion):
    """No centre of mass may move farther than a limit after a time."""

    bodies: Sequence[Body]
    after: float  # [s]
    limit: float = 1e-3  # [m]
    name: str = "creep"
    start: list[Floats] = field(default_factory=list)

    @property
    def wanted(self) -> str:  # type: ignore[override]
        """The limit in words."""
        return f"at most {self.limit * 1e3:g} mm after {self.after:g} s"

    def measure(self, time: float) -> None:
        """Store the centres once."""
        if time >= self.after and not self.start:
            self.start = [body.center_of_mass() for body in self.bodies]

    def result(self) -> tuple[str, bool]:
        """Return the largest displacement of a centre, and whether it is within the limit."""
        ends = [body.center_of_mass() for body in self.bodies]
        most = max(float(np.linalg.norm(b - a)) for a, b in zip(self.start, ends, strict=True))
        return f"{most * 1e3:.2g} mm", most <= self.limit


@dataclass
class MomentumKept(Criterion):
    """The momentum and angular momentum of a closed system must not change."""

    bodies: Sequence[Body]
    limit: float = 1e-6  # relative to the sum of the sizes of the bodies' momenta at the start
    name: str = "change of momentum, angular momentum"
    start: tuple[Floats, Floats, float, float] | None = None
    largest: float = 0.0

    wanted = "at most 1e-06 of it"

    def _totals(self) -> tuple[Floats, Floats]:
        return (
            np.sum([body.momentum() for body in self.bodies], axis=0),
            np.sum([body.angular_momentum() for body in self.bodies], axis=0),
        )

    def begin(self) -> MomentumKept:
        """Store the totals at the start. Returns: this criterion."""
        momentum, turn = self._totals()
        size = sum(float(np.linalg.norm(body.momentum())) for body in self.bodies)
        length = max(float(np.ptp(body.positions(), axis=0).max()) for body in self.bodies)
        self.start = momentum, turn, size, size * length
        return self

    def measure(self, time: float) -> None:
        """Measure nothing before the end."""

    def result(self) -> tuple[str, bool]:
        """Return the larger relative change, and whether it is within the limit."""
        assert self.start is not None
        momentum, turn, size, turn_size = self.start
        now, turn_now = self._totals()
        change = max(np.abs(now - momentum).max() / size, np.abs(turn_now - turn).max() / turn_size)
        return f"{change:.1g}", bool(change <= self.limit)


def whole(bodies: Sequence[Body]) -> Finally:
    """Return the criterion that no body is frozen."""
    return Finally("frozen bodies", lambda: float(sum(body.is_frozen for body in bodies)), 0.0, 0.0, "")


def apart(bodies: Sequence[Body], limit: float, every: int = 4) -> Most:
    """Return the criterion that no two solids overlap by more than `limit` [m]."""

    def deepest() -> float:
        boxes = [body.aabb() for body in bodies]
        pairs = [
            (i, k)
            for i, k in combinations(range(len(bodies)), 2)
            if (boxes[i][0] < boxes[k][1]).all() and (boxes[k][0] < boxes[i][1]).all()
        ]
        return max((overlap(bodies[i], bodies[k]) for i, k in pairs), default=0.0) * 1e3

    return Most("overlap", deepest, limit * 1e3, "mm", every=every)
