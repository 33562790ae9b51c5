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
    """(lag, h, s) -> time for which forces act on velocities in substep `s` [s].

    These are the forces at the old positions. `h` is the length of the substep [s]. `lag` is the time by
    which velocities are behind positions [s]."""
    drive_time: Any
    """(h, s, substeps) -> time for which external forces act before substep `s` [s].

    If `s` equals `substeps`, the result is the time for which external forces act after the last
    substep."""
    hold: Any
    """(state, program, body, h, felt): add internal forces at the old positions, reactions of pins, and
    forces of grabs."""
    predict: Any
    """(state, program, body, job, felt): compute new velocities.

    Returns: highest speed of a particle [m/s]; highest and mean speed relative to the job's velocity [m/s];
    and 1, or 0 if forces changed a velocity by too much."""
    check: Any
    """(state, body, h, is_last) -> 1 if the body kept its shape in a substep."""
    advance: Any = None
    """(x, v, a, h, kick) -> new position and velocity of one particle; None if the integrator solves
    linear systems."""
    lag: float = 0.0  # number of substeps by which velocities are behind positions
    is_lag_told: bool = False  # True if reads return velocities at the time of the positions
    has_stable_step: bool = True  # True if bodies explode in substeps above a stable length
    has_hulls: bool = True  # True if bodies can have contact hulls
    drifts_at_once: bool = True  # True if the kick also moves a body that is alone in its island
    halvings: int = 0  # largest number of halvings of a failed substep; 0: the world's `retries`
    work: int = 1  # approximate cost of a substep, as a multiple of leapfrog's cost
    only_flat: bool = False  # True if the integrator needs the schedule `flat`
    warning: str = ""  # text of a warning for users; empty for none

    @property
    def takes_solves(self) -> bool:
        """True if new velocities are solutions of linear systems, one per substep and body."""
        return self.advance is None

    def __repr__(self) -> str:
        """Return the name, because addresses of functions would differ between runs."""
        return f"IntegratorModel({self.name.value!r})"
