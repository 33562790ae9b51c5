"""Measure a running world for the page: step times, speed relative to real time, energies."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np

from taichi_soft import World

STEPS = 600
"""Number of recent steps whose percentiles are reported."""

SHARE = 0.05
"""Largest fraction of time that is spent on the computation of energies."""


class Meters:
    """Step times and energies of a world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._begun: list[float] = []  # start times of the steps since `begin`
        self._times: deque[float] = deque(maxlen=STEPS)
        self._simulated = self._since = self._factor = 0.0
        self._energies: dict[str, float] = {}
        self._energies_due = 0.0

    def begin(self) -> None:
        """Start recording the steps of a frame."""
        self._begun.clear()

    def begin_step(self) -> None:
        """Record the start of a step."""
        self._begun.append(time.perf_counter())

    def end(self, simulated: float) -> None:
        """Record the end of the steps since `begin`; `simulated` is the world time that passed [s]."""
        ends = [*self._begun[1:], time.perf_counter()]
        self._times.extend(end - start for start, end in zip(self._begun, ends, strict=False))
        self._simulated += simulated

    def values(self, now: float) -> dict[str, Any]:
        """Return the measured values by name.

        Args:
            now: current time [s].
        Returns: 50th and 99th percentile of the step time [ms]; simulated time divided by real time; energies
            [J] and momentum [N s].
        """
        if now >= self._energies_due:
            self._energies = self._measured_energies()
            self._energies_due = now + (time.perf_counter() - now) / SHARE
        elapsed = now - self._since
        if elapsed >= 0.5:
            self._factor, self._simulated, self._since = self._simulated / elapsed, 0.0, now
        times = np.array(self._times) if self._times else np.zeros(1)
        return {
            "step_ms": [round(1e3 * float(q), 3) for q in np.percentile(times, (50, 99))],
            "factor": round(self._factor, 3),
            "energies": self._energies,
        }

    def _measured_energies(self) -> dict[str, float]:
        bodies = self._world.bodies
        return {
            "kinetic": sum(body.kinetic_energy() for body in bodies),
            "elastic": sum(body.elastic_energy() for body in bodies),
            "potential": sum(body.gravitational_energy() for body in bodies),
            "momentum": float(np.linalg.norm(sum((body.momentum() for body in bodies), np.zeros(3)))),
        }
