"""Read the fields of a built world in the caller's order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.kernels.evaluate import compute_body_forces
from taichi_soft.bodies.kernels.origins import write_view_origin
from taichi_soft.bodies.kernels.plasticity import read_rest_inverses
from taichi_soft.bodies.kernels.readout import read_exact_positions, read_positions, read_velocities
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.render_mesh import RenderMesh, read_render_mesh
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.control.joints import Joints
from taichi_soft.control.kernels.joints import add_joint_forces
from taichi_soft.core.checks import as_buffer
from taichi_soft.core.constants import NEAR
from taichi_soft.core.errors import OptionError
from taichi_soft.core.residue import rounding_error
from taichi_soft.core.settings import Settings
from taichi_soft.solver.program import StepProgram
from taichi_soft.solver.state import State

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]


class Readout:
    """Reader of the positions, velocities, render meshes and rest shapes of a world's bodies."""

    def __init__(
        self, settings: Settings, state: State, program: StepProgram, scene: Scene, joints: Joints
    ) -> None:
        self.settings = settings
        self._state, self._program, self._scene, self._joints = state, program, scene, joints
        # Cached positions of all particles.
        self._rows: Floats32 = np.empty((scene.particle_count, 3), dtype=np.float32)
        # Interpolation factor of `_rows`, and True if they are relative to `view_origin`; None if outdated.
        self._kind: tuple[float, bool] | None = None
        self.view_origin = np.zeros(3)

    def has_moved(self) -> None:
        """Mark the cached positions as outdated, because bodies have moved."""
        self._kind = None

    def set_view_origin(self, point: Floats) -> None:
        """Implement `World.set_view_origin`."""
        self.view_origin = point
        view = np.concatenate([point, rounding_error(point)]).astype(np.float32)
        write_view_origin(self._state, view)
        self.has_moved()

    def drawn_positions(self, body: SoftBody, alpha: float, out: Floats32 | None) -> Floats32:
        """Implement `World.read_positions`. Raises: OptionError if `out` does not fit."""
        return self.positions(body, alpha, out, is_relative=bool(self.view_origin.any()))

    def positions(
        self, body: SoftBody, alpha: float, out: Floats32 | None, *, is_relative: bool = False
    ) -> Floats32:
        """Return interpolated positions of a body in the world, or relative to `view_origin`, (n, 3) [m].

        Raises: OptionError if `out` does not fit.
        """
        rows = as_buffer(out, "out", body.vertex_count)
        if self._kind != (alpha, is_relative):
            read_positions(self._state, alpha, int(is_relative), self._rows)
            self._kind = alpha, is_relative
        begin = self._scene.ranges[body.index].particles[0]
        rows[:] = self._rows[begin : begin + body.vertex_count]
        return rows

    def exact_positions(self, body: SoftBody) -> Floats:
        """Return the positions of the vertices of a body in float64, (n, 3) [m]."""
        rows = self.positions(body, 1.0, None).astype(np.float64)
        if np.abs(rows).max() > NEAR:
            read_exact_positions(self._state, body.index, rows)
        return rows

    def render_mesh(
        self, mesh: RenderMesh, alpha: float, positions: Floats32 | None, normals: Floats32 | None
    ) -> tuple[Floats32, Floats32]:
        """Implement `World.read_render_mesh`. Raises: OptionError for a buffer that does not fit."""
        x = as_buffer(positions, "positions", mesh.vertex_count)
        n = as_buffer(normals, "normals", mesh.vertex_count)
        if np.may_share_memory(x, n):  # the answer is exact for contiguous arrays
            raise OptionError("positions and normals share memory: give each a buffer of its own")
        read_render_mesh(self._state, mesh, alpha, x, n)
        return x, n

    def velocities(self, body: SoftBody) -> Floats32:
        """Return the velocities of a body at the time of its positions, (n, 3) [m/s]."""
        state, settings = self._state, self.settings
        rows = np.empty((body.vertex_count, 3), dtype=np.float32)
        read_velocities(state, self._scene.ranges[body.index].particles[0], body.vertex_count, rows)
        lag = float(state.body_velocity_lag[body.index])
        if self._program.integrator.is_lag_told and lag > 0.0 and not body.is_frozen:
            forces = np.empty_like(rows)
            compute_body_forces(state, self._program, body.index, forces)
            if self._joints.holds(body):
                add_joint_forces(state, body.index, lag, forces)
            by_vertex = forces[self._scene.bodies[body.index].rank]
            acceleration = by_vertex / body.masses[:, None] + settings.gravity * body.gravity_scale
            acceleration[body.pinned] = 0.0
            # Do not advance the velocities of touching vertices, which already include contact.
            acceleration[self._is_carried(body)] = 0.0
            rows += (0.5 * lag * acceleration).astype(np.float32)
        return rows

    def _is_carried(self, body: SoftBody) -> NDArray[np.bool_]:
        """Return a mask of the vertices that touched something in the last substep, (n,)."""
        if self._program.has_contact:
            begin = self._scene.ranges[body.index].particles[0]
            touches = self._state.particle_touches.to_numpy()[begin : begin + body.vertex_count]
            return np.asarray(touches[self._scene.bodies[body.index].rank] == 1)
        floor = self.settings.floor
        if floor is None:
            return np.zeros(body.vertex_count, dtype=np.bool_)
        return np.asarray(body.positions()[:, 2] <= floor)

    def rest_inverses(self, body: SoftBody) -> Floats:
        """Return the inverse edge matrix A^-1 of each tetrahedron's current rest shape, (m, 3, 3) [1/m].

        Tetrahedra are in the caller's order.
        """
        rows = np.empty((len(body.tets), 3, 3), dtype=np.float32)
        read_rest_inverses(self._state, body.index, rows)
        inverses = np.empty(rows.shape)
        inverses[self._scene.bodies[body.index].tet_order] = rows
        return inverses
