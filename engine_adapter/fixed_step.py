"""Fixed steps out of frames of any length."""

from __future__ import annotations

from dataclasses import dataclass

from taichi_soft.core.checks import as_count, as_step

ROUND_OFF = 1e-9
"""Part of a step that may be missing when the step is due. Sums of frame times are rounded: six frames of
1/60 s are not quite 1/10 s. A billionth covers the rounding of years of frames and is never seen."""


@dataclass(frozen=True)
class FixedStep:
    """How a game loop's time is cut into steps.

    Args:
        dt: length of one step [s], as `World.step` takes it.
        substeps: equal parts of a step, 1 or more; None: the world chooses what is stable.
        max_steps: most steps that one frame may make, 1 or more. Time beyond is dropped: a machine too slow
            for the simulation then shows slow motion, not ever longer frames.
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
    """Time put in, given out again in whole steps.

    At any moment: time put in = steps given out * dt + time dropped + `remainder`.
    """

    def __init__(self, fixed_step: FixedStep) -> None:
        self._dt = fixed_step.dt
        self._max_steps = fixed_step.max_steps
        self.remainder = 0.0  # [s], from -ROUND_OFF to 1 - ROUND_OFF of dt

    @property
    def alpha(self) -> float:
        """`remainder` as a part of dt, at least 0 and below 1."""
        return max(self.remainder / self._dt, 0.0)

    def put(self, frame_dt: float) -> tuple[int, float]:
        """Put in a frame [s], 0 or more and finite. Returns: steps that are due, time dropped [s]."""
        waiting = self.remainder + frame_dt
        due = waiting / self._dt + ROUND_OFF
        if due >= self._max_steps + 1:
            self.remainder = 0.0
            return self._max_steps, waiting - self._max_steps * self._dt
        steps = int(due)
        self.remainder = waiting - steps * self._dt
        return steps, 0.0
