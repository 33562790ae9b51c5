"""Interface of an integrator."""

from dataclasses import dataclass
from typing import Any

from taichi_soft.core.types import Integrator


@dataclass(frozen=True, repr=False)
class IntegratorModel:
    """Five Taichi functions that convert forces to motion, and properties of the integrator.

    No other code distinguishes integrators.
    """

    name: Integrator
    felt_time: Any
    """(lag, h, s) -> time for which the forces at the old positions act on velocities in substep `s` of `h`
    [s].

    `lag` is the time by which velocities are behind positions [s]."""
    drive_time: Any
    """(h, s, substeps) -> time for which external forces act before substep `s` [s]. If `s` equals
    `substeps`, the time after the last substep."""
    hold: Any
    """(state, program, body, h, felt): add the forces at the old positions, and the forces of pins and
    grabs."""
    predict: Any
    """(state, program, body, job, felt): compute new velocities. Returns the highest speed [m/s]; the highest
    and the mean speed relative to the job's velocity; 1 if forces changed no velocity too much."""
    check: Any
    """(state, body, h, is_last) -> 1 if the body kept its shape in a substep."""
    advance: Any = None
    """(x, v, a, h, kick) -> position and velocity of one particle, for the schedule `flat`; None if not
    supported."""
    lag: float = 0.0  # time by which velocities are behind positions, in substeps
    is_lag_told: bool = False  # True if readers get velocities at the time of the positions
    has_stable_step: bool = True  # True if longer substeps explode
    has_hulls: bool = True
    drifts_at_once: bool = True  # True if the kick can also move a body that touches no other
    halvings: int = 0  # number of times a failed substep is halved; 0 for the world's `retries`
    work: int = 1  # approximate cost of a substep, over that of leapfrog
    only_flat: bool = False  # True if `drift.py` does not support how it moves particles
    warning: str = ""  # warning for users of the integrator

    @property
    def takes_solves(self) -> bool:
        """True if new velocities are solutions of linear systems, one per substep and body."""
        return self.advance is None

    def __repr__(self) -> str:
        """Return the name, because addresses of functions would differ between runs."""
        return f"IntegratorModel({self.name.value!r})"
