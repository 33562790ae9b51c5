"""The drop in Bullet (zlib licence) through PyBullet: a deformable body of stable neo-Hookean material.

Bullet's constants differ from Lame's: 4/3 mu and lambda + 5/6 mu give Hooke's law for small strain (Smith, de
Goes and Kim 2018, section 3.4). PyBullet gives all vertices the same mass and allows no other masses. A body
at rest floats above the floor by the collision margin, so the margin is small. The floor is a box, because a
body would float 0.1 m above Bullet's plane.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lab.peers.drop import GRAVITY, Drop
from lab.peers.silence import silenced
from lab.peers.trajectory import RATE, Progress, Simulation, Trajectory, record

FIRST = 2
"""Number of steps per 1 / RATE s with Bullet's default step of 1/240 s."""

MARGIN = 1e-3
"""Gap between body and floor [m]."""

FLOOR = 5.0
"""Half the height of the box that serves as the floor [m]. The box is six times as wide as this value."""


def simulate(drop: Drop, on_frame: Progress | None = None) -> Trajectory:
    """Simulate the drop in Bullet."""
    with silenced():
        import pybullet

        client = pybullet.connect(pybullet.DIRECT)
    try:
        return record(drop, lambda steps: _make(drop, client, steps), FIRST, on_frame)
    finally:
        pybullet.disconnect(client)


def _make(drop: Drop, client: int, steps: int) -> Simulation:
    import pybullet

    step = 1 / (RATE * steps)
    pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
    pybullet.setGravity(0, 0, -GRAVITY, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=step, physicsClientId=client)
    box = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[3 * FLOOR, 3 * FLOOR, FLOOR], physicsClientId=client
    )
    floor = pybullet.createMultiBody(0, box, basePosition=[0, 0, -FLOOR], physicsClientId=client)
    pybullet.changeDynamics(floor, -1, lateralFriction=0, physicsClientId=client)
    lam, mu = drop.lame
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "body.vtk"
        path.write_text(_vtk(drop), encoding="ascii")
        body = pybullet.loadSoftBody(
            str(path),
            mass=float(drop.masses.sum()),
            useNeoHookean=1,
            NeoHookeanMu=4 / 3 * mu,
            NeoHookeanLambda=lam + 5 / 6 * mu,
            NeoHookeanDamping=0,
            frictionCoeff=0,
            collisionMargin=MARGIN,
            useSelfCollision=0,
            physicsClientId=client,
        )

    def advance() -> None:
        for _ in range(steps):
            pybullet.stepSimulation(physicsClientId=client)

    def positions() -> NDArray[np.float64]:
        flags = pybullet.MESH_DATA_SIMULATION_MESH
        return np.array(pybullet.getMeshData(body, -1, flags=flags, physicsClientId=client)[1])

    return Simulation(advance, positions, step)


def _vtk(drop: Drop) -> str:
    """Return the mesh at the start of the drop as the text of a VTK file, version 2.0."""
    points, tets = drop.start.tolist(), drop.mesh.tets.tolist()
    head = ["# vtk DataFile Version 2.0", "body", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    rows = [" ".join(map(repr, point)) for point in points]
    cells = ["4 " + " ".join(map(str, tet)) for tet in tets]
    kinds = [f"CELL_TYPES {len(tets)}", *["10"] * len(tets)]
    lines = [*head, f"POINTS {len(points)} double", *rows, f"CELLS {len(tets)} {5 * len(tets)}", *cells]
    return "\n".join([*lines, *kinds, ""])
