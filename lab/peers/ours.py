"""The drop in taichi-soft with the default law, integrator and substeps."""

from __future__ import annotations

import numpy as np

from lab.peers.drop import Drop
from lab.peers.trajectory import RATE, Progress, Simulation, Trajectory, record
from taichi_soft import Material
from taichi_soft.world.bare import bare_world


def simulate(drop: Drop, on_frame: Progress | None = None) -> Trajectory:
    """Simulate the drop in taichi-soft."""
    material = Material(drop.young, drop.poisson, drop.density, damping=0.0, damping_ratio=0.0)

    def make(steps: int) -> Simulation:
        world = bare_world(friction=0.0)
        lift = drop.start[0] - drop.mesh.vertices[0]
        body = world.add_body(drop.mesh, material, position=lift)
        world.build()
        world.warm_up()
        substeps = steps * world.stable_substeps(1 / RATE)
        return Simulation(
            lambda: world.step(1 / RATE, substeps),
            lambda: body.positions().astype(np.float64),
            1 / (RATE * substeps),
        )

    return record(drop, make, 1, on_frame)
