"""The interface of an integrator."""

from dataclasses import dataclass
from typing import Any

from taichi_soft.core.types import Integrator


@dataclass(frozen=True, repr=False)
class IntegratorModel:
    """Five Taichi functions that convert forces to motion, and the properties that a world must know.

    No other code asks which integrator runs.
    """

    name: Integrator
    felt_time: Any
    """(lag, h, s) -> time for which forces of the old positions act on velocities in substep `s` of `h` [s].

    `lag` is the time by which velocities are behind positions [s]."""
    drive_time: Any
    """(h, s, substeps) -> time for which external forces act before substep `s`, or after the last one if `s`
    is `substeps` [s]."""
    hold: Any
    """(state, program, body, h, felt): add the forces of the old positions, and those of pins and grabs."""
    predict: Any
    """(state, program, body, job, felt) -> new velocities. Returns the highest speed [m/s]; the highest and
    the mean relative to the job's velocity; 1 if forces changed no velocity by too much."""
    check: Any
    """(state, body, h, is_last) -> 1 if a body kept its shape in a substep."""
    advance: Any = None
    """(x, v, a, h, kick) -> position and velocity of one particle, for the schedule `flat`; or None."""
    lag: float = 0.0  # time by which velocities are behind positions, over the substep
    is_lag_told: bool = False  # readers get velocities at the time of the positions
    has_stable_step: bool = True  # longer substeps explode
    has_hulls: bool = True
    drifts_at_once: bool = True  # the kick can move a single body at once
    halvings: int = 0  # of failed substeps; 0: the world's `retries`
    work: int = 1  # approximate cost of a substep over one of leapfrog
    only_flat: bool = False  # it moves particles in a way that `drift.py` does not
    warning: str = ""  # shown to its users

    @property
    def takes_solves(self) -> bool:
        """True if new velocities come from linear solves, one per substep and body."""
        return self.advance is None

    def __repr__(self) -> str:
        """Return the name: addresses of functions would differ from run to run."""
        return f"IntegratorModel({self.name.value!r})"
