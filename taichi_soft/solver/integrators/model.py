"""What a step asks of an integrator."""

from dataclasses import dataclass
from typing import Any

from taichi_soft.core.types import Integrator


@dataclass(frozen=True, repr=False)
class IntegratorModel:
    """How forces become motion: five functions of Taichi, and what a world has to know beside them.

    Nothing else in the project asks which integrator runs.
    """

    name: Integrator
    felt_time: Any
    """(lag, h, s) -> for how long forces of the old positions act on velocities in substep `s` of `h` [s].

    `lag` is how far velocities are behind positions [s].
    """
    drive_time: Any
    """(h, s, substeps) -> for how long drives act before substep `s` [s]; after the last one if it is
    `substeps`."""
    hold: Any
    """(state, program, body, h, felt): add the forces of the old positions, and of what holds the body."""
    predict: Any
    """(state, program, body, job, felt) -> new velocities: highest speed [m/s]; highest and mean beside the
    job's velocity; whether forces changed no velocity by too much (1)."""
    check: Any
    """(state, body, h, is_last) -> whether a body has kept its shape in a substep (1)."""
    advance: Any = None
    """(x, v, a, h, kick) -> position and velocity of one particle, for the schedule `flat`; or None."""
    lag: float = 0.0  # of velocities behind positions, over the substep
    is_lag_told: bool = False  # those that are read are brought to the time of the positions
    has_stable_step: bool = True  # longer substeps explode
    has_hulls: bool = True
    drifts_at_once: bool = True  # a body alone, with its new velocities
    halvings: int = 0  # of substeps that fail; 0: as the world says by `retries`
    work: int = 1  # of a substep, about, over one of leapfrog
    only_flat: bool = False  # it has no colliders
    warning: str = ""  # to those who use it

    @property
    def takes_solves(self) -> bool:
        """True if new velocities come from linear solves, one per substep and body."""
        return self.advance is None

    def __repr__(self) -> str:
        """Its name: addresses of functions would differ from run to run."""
        return f"IntegratorModel({self.name.value!r})"
