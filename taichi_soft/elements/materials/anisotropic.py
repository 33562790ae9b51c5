"""Anisotropic materials: wood, muscle, laminates (thesis 2.4 and chapter 7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array, as_rotation, as_rotations, to_array
from taichi_soft.core.errors import MaterialError
from taichi_soft.core.serialisation import serialised
from taichi_soft.elements.materials.element_values import (
    LARGEST,
    POSITIVE,
    Array,
    as_constant,
    as_ratio,
    described,
    is_damping,
    is_positive,
    require_one_length,
    spread,
)
from taichi_soft.elements.materials.material import DAMPING_RATIO
from taichi_soft.elements.materials.stiffness import Stiffness, rotate_stiffness


@serialised("stiffness", "density", "damping", "frame", "damping_ratio")
@dataclass(frozen=True, eq=False)
class AnisotropicMaterial:
    """A linearly elastic, damped material whose stiffness depends on direction.

    Args:
        stiffness: a `Stiffness` in the axes of the material, or a sequence with one `Stiffness` per
            tetrahedron.
        density: mass per volume [kg/m^3], above 0: a number, or an array with one number per tetrahedron.
        damping: b of thesis eq. 3.9 [N s/m], 0 or more: a number, or an array with one number per
            tetrahedron.
        frame: rotation whose columns are the material's axes in the mesh: a matrix (3, 3) or a quaternion
            (x, y, z, w). For one rotation per tetrahedron, pass matrices (m, 3, 3) or quaternions (m, 4), for
            example from `frames_along`. None for the axes of the mesh.
        damping_ratio: see `Material`.
    Raises: MaterialError or OptionError with the first value out of range.
    """

    stiffness: Stiffness | Sequence[Stiffness]
    density: float | Array
    damping: float | Array = 0.0
    frame: Any = None
    damping_ratio: float = DAMPING_RATIO

    def __repr__(self) -> str:
        return described(self)

    def __post_init__(self) -> None:
        if not isinstance(self.stiffness, Stiffness):
            object.__setattr__(self, "stiffness", _one_per_tet(self.stiffness))
        density = as_constant(
            self.density, "density", "tetrahedron", is_positive, f"above 0 kg/m^3, {POSITIVE}"
        )
        damping = as_constant(
            self.damping, "damping", "tetrahedron", is_damping, f"0 N s/m or more and below {LARGEST:g}"
        )
        object.__setattr__(self, "density", density)
        object.__setattr__(self, "damping", damping)
        object.__setattr__(self, "damping_ratio", as_ratio(self.damping_ratio))
        object.__setattr__(self, "frame", _frame(self.frame))
        frames = self.frame if np.ndim(self.frame) == 3 else None
        given = {"density": density, "damping": damping, "frame": frames}
        if not isinstance(self.stiffness, Stiffness):
            given["stiffness"] = np.zeros(len(self.stiffness))
        require_one_length(given, "tetrahedron")

    def per_tet(self, name: str, tet_count: int) -> Array:
        """Return `density` or `damping` of each of `tet_count` tetrahedra, (tet_count,).

        Args:
            name: "density" or "damping".
            tet_count: number of tetrahedra.
        Raises: MaterialError if the constant is an array of another length.
        """
        return spread(getattr(self, name), name, "tetrahedra", tet_count)

    def require_count(self, tet_count: int) -> None:
        """Check that the constants and the frame fit a number of tetrahedra.

        Args:
            tet_count: number of tetrahedra.
        Raises: MaterialError if a constant or the frame has another number of values.
        """
        self.per_tet("density", tet_count)
        self.per_tet("damping", tet_count)
        if np.ndim(self.frame) == 3 and len(self.frame) != tet_count:
            raise MaterialError(
                f"frame has {len(self.frame)} rotations for a mesh of {tet_count} tetrahedra: pass one each"
            )
        if not isinstance(self.stiffness, Stiffness) and len(self.stiffness) != tet_count:
            raise MaterialError(
                f"stiffness has {len(self.stiffness)} entries for a mesh of {tet_count} tetrahedra: "
                "pass one each"
            )

    def of_tets(self, rows: NDArray[np.int64]) -> AnisotropicMaterial:
        """Return the material of a subset of the tetrahedra.

        Args:
            rows: indices of the tetrahedra, (k,).
        """
        lists = {"density": 1, "damping": 1, "frame": 3}
        given = {
            name: getattr(self, name) for name, ndim in lists.items() if np.ndim(getattr(self, name)) == ndim
        }
        lists_of_rows = {name: value[rows] for name, value in given.items()}
        if not isinstance(self.stiffness, Stiffness):
            lists_of_rows["stiffness"] = [self.stiffness[row] for row in rows]
        return replace(self, **lists_of_rows)

    def stiffness_matrices(self, tet_count: int) -> Array:
        """Return the stiffness of each tetrahedron in the mesh's axes, (m, 6, 6) [Pa], see `Stiffness`.

        Args:
            tet_count: number of tetrahedra m.
        Raises: MaterialError if a constant or the frame has another number of values.
        """
        self.require_count(tet_count)
        each = [self.stiffness] if isinstance(self.stiffness, Stiffness) else self.stiffness
        own = np.stack([stiffness.matrix for stiffness in each])
        matrices = rotate_stiffness(own, np.atleast_3d(self.frame).reshape(-1, 3, 3))
        return np.ascontiguousarray(np.broadcast_to(matrices, (tet_count, 6, 6)))


def frames_along(directions: ArrayLike) -> NDArray[np.float64]:
    """Return a frame for each direction, such as the direction of fibres. The first axis of the frame points
    along the direction.

    Args:
        directions: directions of the fibres, (m, 3), of any length except zero.
    Returns: rotation matrices, (m, 3, 3), with the smallest possible angles. Use the matrices as the `frame`
        of an `AnisotropicMaterial` with `Stiffness.one_axis`.
    Raises: MaterialError for a direction that is zero.
    """
    rows = as_array(directions, "directions", (None, 3))
    lengths = np.linalg.norm(rows, axis=1)
    if len(rows) == 0 or not lengths.min() > 0:
        where = f" {int(lengths.argmin())} is zero" if len(rows) else " are missing"
        raise MaterialError(f"directions{where}: pass the fibre's direction in every tetrahedron")
    along = rows / lengths[:, None]
    # Use the smallest rotation that maps x to the direction. For the direction -x, use half a turn about z.
    frames = np.empty((len(rows), 3, 3))
    cosine = along[:, 0]
    axis = np.cross([1.0, 0.0, 0.0], along)
    factor = 1 / np.maximum(1 + cosine, 1e-12)
    for column, unit in enumerate(np.eye(3)):
        turn = np.cross(axis, unit)
        frames[:, :, column] = cosine[:, None] * unit + turn + (axis @ unit * factor)[:, None] * axis
    frames[cosine < -1 + 1e-9] = np.diag([-1.0, -1.0, 1.0])
    return frames


def _one_per_tet(values: Any) -> tuple[Stiffness, ...]:
    stiffnesses = tuple(values) if isinstance(values, Sequence) else (values,)
    wrong = next((each for each in stiffnesses if not isinstance(each, Stiffness)), None)
    if wrong is not None or not stiffnesses:
        kind = type(values if wrong is None or len(stiffnesses) == 1 else wrong).__name__
        raise MaterialError(
            f"stiffness must be a taichi_soft.Stiffness, or one per tetrahedron, got {kind}: "
            "make it with Stiffness.orthotropic(...), or Stiffness(matrix)"
        )
    return stiffnesses


def _frame(value: Any) -> Array:
    """Check a frame, and return a read-only rotation (3, 3), or one rotation per tetrahedron, (m, 3, 3)."""
    if value is None or to_array(value, "frame").shape in ((4,), (3, 3)):
        frame: Array = as_rotation(value).copy()
    else:
        frame = as_rotations(value, "frame")
    frame.flags.writeable = False
    return frame
