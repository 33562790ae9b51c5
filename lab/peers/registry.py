"""Registry of the other engines that simulate the drop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lab.peers import bullet, mujoco_flex, newton_vbd
from lab.peers.drop import Drop
from lab.peers.trajectory import Progress, Trajectory


@dataclass(frozen=True)
class Peer:
    """Another engine, or one of its integrators."""

    name: str
    module: str  # Python module of the engine, as in the extra `peers`
    simulate: Callable[[Drop, Progress | None], Trajectory]


PEERS = (
    Peer("MuJoCo, implicit", "mujoco", mujoco_flex.simulate_discrete),
    Peer("MuJoCo, explicit", "mujoco", mujoco_flex.simulate_euler),
    Peer("PyBullet", "pybullet", bullet.simulate),
    Peer("Newton on the CPU", "newton", newton_vbd.simulate),
)
