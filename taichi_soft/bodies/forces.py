"""Internal forces of a mesh without a world, for tests and material studies."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from taichi_soft.bodies.capacity import BodyCapacity
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.fields import BodyFields, acquire, release
from taichi_soft.bodies.kernels.evaluate import compute_body_forces
from taichi_soft.bodies.kernels.readout import write_motion
from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.layout import Scene, arrange
from taichi_soft.core.conflicts import SOLVED
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.core.runtime import init
from taichi_soft.core.threads import in_turn
from taichi_soft.core.types import DampingModel, DampingModelName, FlipsName, LawName, StrainName
from taichi_soft.elements.kernels.gradients import (
    compute_bond_stiffness,
    compute_system_stiffness,
    compute_tet_stiffness,
    compute_volume_pull,
)
from taichi_soft.elements.laws import element_model, fit_model
from taichi_soft.elements.materials import AnyMaterial
from taichi_soft.meshing import BodyMesh
from taichi_soft.meshing.arrays import LARGEST_COORDINATE

Floats = NDArray[np.float64]


def internal_forces(
    mesh: BodyMesh,
    material: AnyMaterial,
    positions: ArrayLike,
    velocities: ArrayLike | None = None,
    *,
    law: LawName = "virial",
    strain: StrainName | None = None,
    flips: FlipsName | None = None,
    damping_model: DampingModelName = DampingModel.EDGE,
    dtype: DTypeLike = np.float64,
) -> NDArray[Any]:
    """Return the elastic and damping forces on every vertex of a deformed mesh [N].

    The computation uses the functions of a running world, in the requested precision.
    Args:
        mesh: mesh at rest.
        material: constants of the body.
        positions: deformed vertices, (n, 3) [m], in the mesh's order.
        velocities: velocities of the vertices, (n, 3) [m/s]; None: zero, so that there is no damping.
        law, strain, flips, damping_model: as for `World.add_body`.
        dtype: float64 or float32, the precision of the computation.
    Returns: forces, (n, 3) of `dtype`.
    Raises: OptionError for an unknown name or dtype; MeshError for arrays of the wrong shape.
    """
    model = fit_model(element_model(law, strain, flips, damping_model), mesh, material)
    real = _real(dtype)
    x = _rows(positions, mesh, "positions", real)
    v = np.zeros_like(x) if velocities is None else _rows(velocities, mesh, "velocities", real)
    return _forces_of(BodyDescription(mesh, material, model), x, v)


def force_gradient(
    mesh: BodyMesh,
    material: AnyMaterial,
    positions: ArrayLike,
    *,
    law: LawName = "virial",
    strain: StrainName | None = None,
    flips: FlipsName | None = None,
    projected: bool = False,
) -> NDArray[np.float64]:
    """Return the derivative of a deformed mesh's elastic forces with respect to its vertices, in float64.

    The derivative is exact, except for the laws of chapter 4. For these laws, it ignores that the normals of
    the planes change (thesis 4.2). The relative error is then 0.1 to 0.6 (Frobenius norm). "cmpm2",
    "best_fitting_plane" and "split_ring_plane" use the matrix that "cmpm" has for an edge with the same
    normal.
    Args:
        mesh, material, positions, law, strain, flips: as for `internal_forces`.
        projected: True for the symmetric, negative semi-definite matrix that implicit Euler uses.
    Returns: df/dx, (n, 3, n, 3) [N/m]. The array is dense, so use it for at most a few hundred vertices.
    Raises: as for `internal_forces`.
    """
    model = fit_model(element_model(law, strain, flips), mesh, material)
    x = _rows(positions, mesh, "positions", np.dtype(np.float64))
    if model.is_shell or model.is_rod:
        raise OptionError(SOLVED.message("force_gradient", f"a {type(mesh).__name__}"))
    if not isinstance(projected, bool):
        raise OptionError(f"projected must be True or False, got {projected!r}")
    static = StaticBody(BodyDescription(mesh, material, model), double=True, implicit=True)
    static.forces(x, np.zeros_like(x))
    return -(static.system_stiffness() if projected else static.exact_stiffness())


class StaticBody:
    """A body that does not move, in separate fields. It evaluates forces like a world."""

    def __init__(self, body: BodyDescription, *, double: bool, implicit: bool = False) -> None:
        """Write the body to fields of float64 if `double`, else of float32. Start Taichi if necessary."""
        init()
        self.body = body
        self._rows = arrange(body)
        self._program = Program((body.model,))
        scene = Scene()
        scene.append(self._rows)
        self._state = acquire(
            BodyFields, BodyCapacity.of(scene, double=double, implicit=implicit), self._program
        )
        weakref.finalize(self, release, self._state)
        self._state.load(scene, [0])

    def forces(self, positions: NDArray[Any], velocities: NDArray[Any]) -> NDArray[Any]:
        """Return the internal forces at `positions` and `velocities`, (n, 3) [N], in the mesh's order."""
        write_motion(self._state, 0, positions, np.zeros_like(positions), velocities)
        rows = np.empty_like(positions)
        compute_body_forces(self._state, self._program, 0, rows)
        return np.asarray(rows[self._rows.rank])

    def exact_stiffness(self) -> Floats:
        """Return -df/dx at the positions of the last call of `forces`, (n, 3, n, 3) [N/m], in mesh order."""
        n, body = len(self._rows.mass), self._rows
        total = np.zeros((n, n, 3, 3))
        if not self.body.model.has_bonds:
            elements = np.zeros((len(body.tet_vertices), 12, 12))
            compute_tet_stiffness(self._state, self.body.model, elements)
            _add_blocks(total, body.tet_vertices, elements)
            return self._in_mesh_order(total)
        bonds = np.zeros((len(body.edge_vertices), 3, 3))
        compute_bond_stiffness(self._state, self.body.model.law, bonds)
        _add_blocks(total, body.edge_vertices, np.block([[bonds, -bonds], [-bonds, bonds]]))
        if self.body.model.reads_expansion:
            gradients, pulls = (np.zeros((len(body.tet_vertices), 4, 3)) for _ in range(2))
            compute_volume_pull(self._state, gradients, pulls)
            outer = pulls.reshape(-1, 12, 1) * gradients.reshape(-1, 1, 12)
            _add_blocks(total, body.tet_vertices, outer)
        return self._in_mesh_order(total)

    def system_stiffness(self) -> Floats:
        """Return the projected -df/dx of implicit Euler, (n, 3, n, 3) [N/m], in mesh order.

        The derivative is at the positions of the last call of `forces`. It is assembled from the blocks of
        particles and edges.
        """
        n, (p, q) = len(self._rows.mass), self._rows.edge_vertices.T
        compute_system_stiffness(self._state, self._program)
        total = np.zeros((n, n, 3, 3))
        total[np.arange(n), np.arange(n)] = self._state.particle_block.to_numpy()[:n]
        blocks = self._state.edge_block.to_numpy()[: len(p)]
        total[p, q] = blocks
        total[q, p] = np.swapaxes(blocks, 1, 2)
        return self._in_mesh_order(total)

    def _in_mesh_order(self, total: Floats) -> Floats:
        rank = self._rows.rank
        return np.asarray(total[rank][:, rank].transpose(0, 2, 1, 3))


def _add_blocks(total: Floats, owners: NDArray[np.int32], elements: Floats) -> None:
    """Add matrices of elements, (m, 3 c, 3 c), to the 3 x 3 blocks of `total`, (n, n, 3, 3).

    Args: owners: the c vertices of each element, (m, c).
    """
    corners = owners.shape[1]
    blocks = elements.reshape(-1, corners, 3, corners, 3)
    for i in range(corners):
        for j in range(corners):
            np.add.at(total, (owners[:, i], owners[:, j]), blocks[:, i, :, j])


_cached: dict[bool, StaticBody] = {}


@in_turn
def _forces_of(body: BodyDescription, positions: NDArray[Any], velocities: NDArray[Any]) -> NDArray[Any]:
    """Evaluate forces [N]. Reuse the static body of the last call if the body is the same."""
    double = positions.dtype == np.float64
    cached = _cached.get(double)
    if cached is not None:
        last_body = cached.body  # compare the parts, because each call makes a new object
        if (last_body.mesh, last_body.material, last_body.model) != (body.mesh, body.material, body.model):
            del _cached[double], cached  # frees the fields of the last body
    if double not in _cached:
        _cached[double] = StaticBody(body, double=double)
    return _cached[double].forces(positions, velocities)


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
        array = np.asarray(values)
        rows = np.array(array, dtype=real if array.dtype.kind in "iuf" else None, order="C")
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
