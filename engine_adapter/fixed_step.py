"""Convert frame times of any length to fixed steps."""

from __future__ import annotations

from dataclasses import dataclass

from taichi_soft.core.checks import as_count, as_step

ROUND_OFF = 1e-9
"""Fraction of a step's length that can be missing when the step becomes due. The sum of frame times has
rounding errors: six frames of 1/60 s are not exactly 1/10 s. A billionth of a step is larger than the
rounding errors that accumulate in years of frames, and too short to be visible."""


@dataclass(frozen=True)
class FixedStep:
    """Length and number of the steps that a game loop makes.

    Args:
        dt: length of a step [s], see `World.step`.
        substeps: number of equal substeps of a step, 1 or more; None lets the world choose a stable number.
        max_steps: largest number of steps per frame, 1 or more. Further time is dropped. If a machine is too
            slow for the simulation, it shows slow motion instead of ever longer frames.
    Raises: OptionError for a value out of range.
    """

    dt: float = 1.0 / 60.0
    substeps: int | None = None
    max_steps: int = 8

    def __post_init__(self) -> None:
        object.__setattr__(self, "dt", as_step(self.dt))
        object.__setattr__(self, "max_steps", as_count(self.max_steps, "max_steps"))
        if self.substeps is not None:
            object.__setattr__(self, "substeps", as_count(self.substeps, "substeps"))


class Accumulator:
    """Accumulates frame times and divides them into steps.

    Invariant: sum of frame times = steps * dt + dropped time + `remainder`.
    """

    def __init__(self, fixed_step: FixedStep) -> None:
        self._dt = fixed_step.dt
        self._max_steps = fixed_step.max_steps
        self.remainder = 0.0  # time not yet simulated [s], from -ROUND_OFF * dt to (1 - ROUND_OFF) * dt

    @property
    def alpha(self) -> float:
        """Return `remainder` divided by dt, at least 0 and below 1."""
        return max(self.remainder / self._dt, 0.0)

    def put(self, frame_dt: float) -> tuple[int, float]:
        """Add a frame time [s], 0 or more and finite. Returns: number of due steps, and dropped time [s]."""
        waiting = self.remainder + frame_dt
        due = waiting / self._dt + ROUND_OFF
        if due >= self._max_steps + 1:
            self.remainder = 0.0
            return self._max_steps, waiting - self._max_steps * self._dt
        steps = int(due)
        self.remainder = waiting - steps * self._dt
        return steps, 0.0
