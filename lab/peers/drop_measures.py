"""Measure the squash and the bounce of a drop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.peers.drop import Drop
from lab.peers.trajectory import Trajectory

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """Squash and bounce of a drop."""

    squash: float  # largest loss of height of the body / its initial height
    bounce: float  # height of the bounce of the centre of mass / height of the drop


def measure(drop: Drop, trajectory: Trajectory) -> Outcome:
    """Measure squash and bounce. A parabola through three recorded values gives each extreme.

    The centre of mass is computed with the masses of the drop, even if an engine uses others.
    """
    tops = trajectory.positions[:, :, 2].max(axis=1)
    centers = trajectory.positions[:, :, 2] @ drop.masses / drop.masses.sum()
    landed = int(np.argmax(trajectory.positions[:, :, 2].min(axis=1) < 0.05 * drop.height))
    turn = landed + int(np.argmax(np.diff(centers[landed:]) > 0.0))  # the centre is lowest
    again = turn + int(np.argmax(np.append(np.diff(centers[turn:]), -1.0) < 0.0))  # the centre is highest
    about = slice(max(landed, turn - 6), turn + 7)
    lowest = about.start + int(tops[about].argmin())
    size = float(np.ptp(drop.mesh.vertices[:, 2]))
    rest = float(centers[0]) - drop.height  # height of the centre when the body touches down
    return Outcome(1.0 - _extreme(tops, lowest) / size, (_extreme(centers, again) - rest) / drop.height)


def _extreme(values: Floats, index: int) -> float:
    """Return the extreme of the parabola through a value and its neighbours."""
    if not 0 < index < len(values) - 1:
        return float(values[index])
    before, here, after = (float(value) for value in values[index - 1 : index + 2])
    bend = before - 2.0 * here + after
    return here if bend == 0.0 else here - (after - before) ** 2 / (8.0 * bend)
