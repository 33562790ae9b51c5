"""Run the drop in every installed engine and in the reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lab.extras import missing_packages
from lab.peers import ours
from lab.peers.drop import Drop
from lab.peers.drop_measures import Outcome, measure
from lab.peers.reference import simulate_reference
from lab.peers.registry import PEERS
from lab.peers.trajectory import Progress, Trajectory

OURS, REFERENCE = "taichi-soft", "reference"


@dataclass(frozen=True)
class Entry:
    """Result of an engine or of the reference."""

    name: str
    trajectory: Trajectory
    outcome: Outcome
    reference: Outcome

    @property
    def is_reference(self) -> bool:
        """True for the result of the reference."""
        return self.name == REFERENCE

    @property
    def cost(self) -> float:
        """Median computing time for 1/60 s of simulation [s]."""
        return float(np.median(self.trajectory.frame_times))

    @property
    def squash_error(self) -> float:
        """Relative error of the squash; positive if the body is squashed too much."""
        return self.outcome.squash / self.reference.squash - 1.0

    @property
    def bounce_error(self) -> float:
        """Relative error of the bounce; positive if the body bounces too high."""
        return self.outcome.bounce / self.reference.bounce - 1.0


def missing_peers() -> list[str]:
    """List the packages of engines that are not installed."""
    return missing_packages("peers")


def compare(
    drop: Drop | None = None, on_frame: Callable[[str, int, int], object] | None = None
) -> list[Entry]:
    """Simulate the drop in taichi-soft, then in the reference, then in each installed engine.

    Args:
        drop: drop to simulate; None for the default drop.
        on_frame: called with (name, frames done, total frames) after each frame.
    """
    drop = Drop() if drop is None else drop
    there = [peer for peer in PEERS if not missing_packages("peers", peer.module)]
    runs = {
        OURS: ours.simulate,
        REFERENCE: simulate_reference,
        **{peer.name: peer.simulate for peer in there},
    }
    trajectories = {name: simulate(drop, _telling(name, on_frame)) for name, simulate in runs.items()}
    outcomes = {name: measure(drop, trajectory) for name, trajectory in trajectories.items()}
    return [
        Entry(name, trajectory, outcomes[name], outcomes[REFERENCE])
        for name, trajectory in trajectories.items()
    ]


def _telling(name: str, on_frame: Callable[[str, int, int], object] | None) -> Progress | None:
    if on_frame is None:
        return None

    def tell(done: int, total: int) -> None:
        on_frame(name, done, total)

    return tell
