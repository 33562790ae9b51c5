"""Interface of an integrator."""

from dataclasses import dataclass
from typing import Any

from taichi_soft.core.types import Integrator


@dataclass(frozen=True, repr=False)
class IntegratorModel:
    """Taichi functions that convert forces to motion, and properties of the integrator.

    No other code distinguishes integrators.
    """

    name: Integrator
    felt_time: Any
    """(lag, h, s) -> time for which the forces at the old positions act on velocities in substep `s` of `h`
    [s].

    `lag` is the time by which velocities are behind positions [s]."""
    drive_time: Any
    """(h, s, substeps) -> time for which external forces act before substep `s` [s]. If `s` equals
    `substeps`, external forces act for this time after the last substep."""
    hold: Any
    """(state, program, body, h, felt): add the forces at the old positions, and the forces of pins and
    grabs."""
    predict: Any
    """(state, program, body, job, felt): compute new velocities. Returns: highest speed [m/s]; highest and
    mean speed relative to the job's velocity [m/s]; 1 if forces changed no velocity by too much."""
    check: Any
    """(state, body, h, is_last) -> 1 if the body kept its shape in a substep."""
    advance: Any = None
    """(x, v, a, h, kick) -> new position and velocity of one particle; None if the integrator solves
    linear systems."""
    lag: float = 0.0  # time by which velocities are behind positions, in substeps
    is_lag_told: bool = False  # True if reads return velocities at the time of the positions
    has_stable_step: bool = True  # True if substeps above a stable length explode
    has_hulls: bool = True  # True if bodies can have contact hulls
    drifts_at_once: bool = True  # True if the kick can also move a body that touches no other body
    halvings: int = 0  # number of times a failed substep is halved; 0 for the world's `retries`
    work: int = 1  # approximate cost of a substep, over the cost with leapfrog
    only_flat: bool = False  # True if only the schedule `flat` supports the integrator
    warning: str = ""  # warning for users of the integrator

    @property
    def takes_solves(self) -> bool:
        """True if new velocities are solutions of linear systems, one per substep and body."""
        return self.advance is None

    def __repr__(self) -> str:
        """Return the name, because addresses of functions would differ between runs."""
        return f"IntegratorModel({self.name.value!r})"
