"""Internal forces of a mesh without a world: for tests and material studies."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from taichi_soft.constants import POSITION_LIMIT
from taichi_soft.errors import MeshError, OptionError
from taichi_soft.kernels.evaluate import compute_body_forces
from taichi_soft.kernels.program import Program
from taichi_soft.kernels.readout import write_motion
from taichi_soft.laws import ElementModel, element_model, require_body
from taichi_soft.materials import Material, SpringMaterial
from taichi_soft.meshing import BodyMesh
from taichi_soft.meshing.arrays import LARGEST_COORDINATE
from taichi_soft.runtime import init
from taichi_soft.scene import BodyDescription, Scene, arrange
from taichi_soft.state import Capacity, acquire, release
from taichi_soft.types import DampingModel, Flips, Integrator, Strain


def internal_forces(
    mesh: BodyMesh,
    material: Material | SpringMaterial,
    positions: ArrayLike,
    velocities: ArrayLike | None = None,
    *,
    law: str = "virial",
    strain: str | Strain | None = None,
    flips: str | Flips | None = None,
    damping_model: str | DampingModel = DampingModel.EDGE,
    dtype: DTypeLike = np.float64,
) -> NDArray[Any]:
    """Elastic and damping forces on every vertex of a deformed mesh [N].

    The functions of a running world, in the precision asked for.
    Args:
        mesh: the body at rest.
        material: constants of the body.
        positions: deformed vertices, (n, 3) [m], in the mesh's order.
        velocities: (n, 3) [m/s]; None leaves damping out.
        law, strain, flips, damping_model: as in `World.add_body`.
        dtype: float64 or float32, the precision of the whole computation.
    Returns: (n, 3) of `dtype`.
    Raises: OptionError for a name or dtype that is not known; MeshError for arrays that do not fit.
    """
    model = element_model(law, strain, flips, damping_model)
    require_body(mesh, material, model)
    real = _real(dtype)
    x = _rows(positions, mesh, "positions", real)
    v = np.zeros_like(x) if velocities is None else _rows(velocities, mesh, "velocities", real)
    return _still_body(mesh, material, model, double=real == np.float64).forces(x, v)


class StillBody:
    """One body in fields of its own: what a world computes with, without its motion."""

    def __init__(self, body: BodyDescription, *, double: bool) -> None:
        """Put it into fields of float64 (`double`) or float32. Starts Taichi if nobody has."""
        init()
        self.body = body
        self._rows = arrange(body)
        self._program = Program((body.model,), Integrator.LEAPFROG, has_floor=False, worker_count=1)
        scene = Scene()
        scene.append(self._rows)
        self._state = acquire(Capacity.of(scene, double=double))
        weakref.finalize(self, release, self._state)
        self._state.load(scene, [0])

    def forces(self, positions: NDArray[Any], velocities: NDArray[Any]) -> NDArray[Any]:
        """Internal forces there, (n, 3) [N], in the mesh's order."""
        write_motion(self._state, 0, positions, velocities)
        rows = np.empty_like(positions)
        compute_body_forces(self._state, self._program, 0, rows)
        return np.asarray(rows[self._rows.rank])


_last: dict[bool, StillBody] = {}


def _still_body(
    mesh: BodyMesh, material: Material | SpringMaterial, model: ElementModel, *, double: bool
) -> StillBody:
    """The body of the last call in this precision if it is the same, for loops over deformations."""
    last = _last.get(double)
    if last is not None:
        body = last.body
        if (body.mesh, body.material, body.model) == (mesh, material, model):  # equal to themselves only
            return last
        del _last[double], last  # their fields serve the next
    _last[double] = StillBody(BodyDescription.at_rest(mesh, material, model), double=double)
    return _last[double]


def _real(dtype: DTypeLike) -> np.dtype[Any]:
    try:
        real = np.dtype(dtype)
    except TypeError:
        raise OptionError(f"dtype must be float64 or float32, got {dtype!r}") from None
    if real not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise OptionError(f"dtype must be float64 or float32, got {real}")
    return real


def _rows(values: ArrayLike, mesh: BodyMesh, name: str, real: np.dtype[Any]) -> NDArray[Any]:
    try:
        given = np.asarray(values)
        rows = np.array(given, dtype=real if given.dtype.kind in "iuf" else None, order="C")
        if rows.dtype != real:
            raise TypeError
    except (TypeError, ValueError):
        raise MeshError(f"{name} must be an array of numbers, got {type(values).__name__}") from None
    if rows.shape != mesh.vertices.shape:
        raise MeshError(f"{name} has shape {rows.shape}: this mesh needs {mesh.vertices.shape}")
    if not np.isfinite(rows).all():
        raise MeshError(f"{name}[{int(np.argmin(np.isfinite(rows).all(axis=1)))}] is not finite")
    limit = POSITION_LIMIT if real == np.float32 else LARGEST_COORDINATE
    if np.abs(rows).max() > limit:
        wider = ": use dtype float64" if real == np.float32 else ""
        raise MeshError(f"{name} go up to {np.abs(rows).max():g}, beyond {limit:g}{wider}")
    return rows
