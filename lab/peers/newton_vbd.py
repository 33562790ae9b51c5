"""The drop in Newton (Apache-2.0) on the CPU by vertex block descent: stable neo-Hookean material.

Newton is made for GPUs. On a CPU its kernels run on one thread, and the first start compiles for one or two
minutes. Contact is a spring under each vertex. The spring is so stiff that the body sinks into the floor by
at most 1 mm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lab.peers.drop import Drop
from lab.peers.trajectory import RATE, Progress, Simulation, Trajectory, record

FIRST = 5
"""Number of steps per 1 / RATE s: 1/600 s each, as in Newton's examples of soft bodies."""

ITERATIONS = 10
"""Iterations of the solver, as in Newton's examples."""

CONTACT, RADIUS = 1e7, 1e-3
"""Stiffness of contact [N/m] and radius of a vertex [m]."""


def simulate(drop: Drop, on_frame: Progress | None = None) -> Trajectory:
    """Simulate the drop in Newton."""
    import warp

    warp.config.log_level = warp.LOG_WARNING
    return record(drop, lambda steps: _make(drop, steps), FIRST, on_frame)


def _make(drop: Drop, steps: int) -> Simulation:
    import newton
    import warp

    step = 1 / (RATE * steps)
    lam, mu = drop.lame
    builder = newton.ModelBuilder()  # its default gravity is that of the drop
    builder.add_ground_plane()
    builder.add_soft_mesh(
        pos=warp.vec3(0.0, 0.0, 0.0),
        rot=warp.quat_identity(),
        scale=1.0,
        vel=warp.vec3(0.0, 0.0, 0.0),
        vertices=[warp.vec3(*row) for row in drop.start.tolist()],
        indices=drop.mesh.tets.ravel().tolist(),
        density=drop.density,
        k_mu=mu,
        k_lambda=lam,
        k_damp=0.0,
        particle_radius=RADIUS,
    )
    builder.color()
    model = builder.finalize(device="cpu")
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = CONTACT, 0.0, 0.0
    solver = newton.solvers.SolverVBD(model, iterations=ITERATIONS, particle_enable_self_contact=False)
    pipeline = newton.CollisionPipeline(model)
    contacts, control = pipeline.contacts(), model.control()
    states = [model.state(), model.state()]

    def advance() -> None:
        for _ in range(steps):
            states[0].clear_forces()
            pipeline.collide(states[0], contacts)
            solver.step(states[0], states[1], control, contacts, step)
            states.reverse()

    def positions() -> NDArray[np.float64]:
        return np.array(states[0].particle_q.numpy(), dtype=np.float64)

    return Simulation(advance, positions, step)
