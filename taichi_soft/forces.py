"""Internal forces of a mesh without a world: for tests and material studies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from taichi_soft.constants import POSITION_LIMIT
from taichi_soft.errors import MeshError, OptionError
from taichi_soft.kernels.evaluate import evaluate_edge_damping, evaluate_tet_forces
from taichi_soft.laws import element_model
from taichi_soft.materials import Material, require_material
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import LARGEST_COORDINATE
from taichi_soft.runtime import init
from taichi_soft.scene import edge_damping, rest_inverses
from taichi_soft.types import DampingModel, Flips, Strain


def internal_forces(
    mesh: TetMesh,
    material: Material,
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

    The same element functions as in a running world, one tetrahedron after the other.
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
    require_material(material)
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"mesh must be a TetMesh, got {type(mesh).__name__}")
    real = _real(dtype)
    x = _rows(positions, mesh, "positions", real)
    v = np.zeros_like(x) if velocities is None else _rows(velocities, mesh, "velocities", real)
    count = len(mesh.tets)
    for name in ("young", "poisson", "density", "damping"):
        material.per_tet(name, count)
    init()

    damping = material.per_tet("damping", count) * (velocities is not None)
    lame = np.stack([material.per_tet("lame_lambda", count), material.per_tet("lame_mu", count)], axis=1)
    out = np.zeros_like(x)
    tets, inverse = np.array(mesh.tets), rest_inverses(mesh).astype(real)
    evaluate_tet_forces(model, x, v, tets, inverse, lame.astype(real), damping.astype(real), out)
    if velocities is not None and model.damping_model is DampingModel.EDGE:
        evaluate_edge_damping(x, v, np.array(mesh.edges), edge_damping(mesh, damping).astype(real), out)
    return out


def _real(dtype: DTypeLike) -> np.dtype[Any]:
    try:
        real = np.dtype(dtype)
    except TypeError:
        raise OptionError(f"dtype must be float64 or float32, got {dtype!r}") from None
    if real not in (np.dtype(np.float64), np.dtype(np.float32)):
        raise OptionError(f"dtype must be float64 or float32, got {real}")
    return real


def _rows(values: ArrayLike, mesh: TetMesh, name: str, real: np.dtype[Any]) -> NDArray[Any]:
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
