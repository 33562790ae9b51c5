"""Stiffness of a linear material, which can be anisotropic (thesis 2.3 and 2.4, eq. 2.25).

A 6x6 matrix maps strain to stress in Voigt's order xx, yy, zz, yz, xz, xy. With engineering shear,
gamma_xy = 2 eps_xy, the matrix is symmetric. The thesis uses the order xx, yy, zz, xy, xz, yz and tensor
shear. `Stiffness.from_thesis` converts a matrix of the thesis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array, as_number, as_positive, as_rotation
from taichi_soft.core.errors import MaterialError
from taichi_soft.core.serialisation import serialised
from taichi_soft.elements.materials.element_values import LARGEST, SMALLEST

Floats = NDArray[np.float64]

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""The two axes of each of Voigt's six components."""

ONE_PLANE = tuple((i, j) for i in range(6) for j in range(i, 6) if (i in (3, 4)) == (j in (3, 4)))
"""Row and column of each entry that can be non-zero if xy is a plane of symmetry. yz and xz then couple only
with each other."""

THESIS_ORDER = (0, 1, 2, 5, 4, 3)
"""Position of each of Voigt's components in the thesis's order, in which xy is fourth and yz is sixth."""


def _as_ratio(value: float, name: str, high: float = 0.5) -> float:
    """Check that a Poisson's ratio is strictly between -1 and `high`, and return it. Raises: OptionError."""
    return as_number(value, name, np.nextafter(-1, 0), np.nextafter(high, 0), f"above -1 and below {high:g}")


def rotate_stiffness(matrix: Floats, rotations: Floats) -> Floats:
    """Rotate a material, and return its stiffness after each rotation, (m, 6, 6) [Pa].

    The result is K C K^T. The matrix K rotates stress in Voigt's order (Bond 1943).
    Args:
        matrix: stiffness C, (6, 6), or one per rotation, (m, 6, 6) [Pa].
        rotations: (m, 3, 3).
    """
    first, second = np.array(PAIRS).T
    R = rotations
    # Stress s rotates as R s R^T. This product contains each component off the diagonal twice.
    K = R[:, first[:, None], first] * R[:, second[:, None], second]
    K[:, :, 3:] += (R[:, first[:, None], second] * R[:, second[:, None], first])[:, :, 3:]
    return np.asarray(K @ matrix @ np.swapaxes(K, 1, 2))


def voigt_stress(matrices: Floats, strain: Floats) -> Floats:
    """Return the stress, (m, 3, 3) [Pa].

    Args:
        matrices: stiffness in Voigt's order, (m, 6, 6) [Pa].
        strain: (m, 3, 3).
    """
    first, second = np.array(PAIRS).T
    rows = strain[:, first, second] * np.array([1, 1, 1, 2, 2, 2])
    stress = np.empty_like(strain)
    stress[:, first, second] = stress[:, second, first] = np.einsum("mab,mb->ma", matrices, rows)
    return stress


@serialised("matrix")
@dataclass(frozen=True, eq=False)
class Stiffness:
    """A symmetric, positive definite stiffness in the axes of its material.

    Args:
        matrix: (6, 6) [Pa], in Voigt's order with engineering shear.
    Raises: MaterialError if the matrix is not symmetric to 1e-6 of its largest entry, or not positive
        definite.
    """

    matrix: Floats

    def __post_init__(self) -> None:
        matrix = as_array(self.matrix, "stiffness", (6, 6), "Pa")
        gap = np.abs(matrix - matrix.T)
        if gap.max() > 1e-6 * np.abs(matrix).max():
            row, column = np.unravel_index(int(gap.argmax()), (6, 6))
            raise MaterialError(
                f"stiffness is not symmetric: entry ({row}, {column}) is {matrix[row, column]:g} and "
                f"({column}, {row}) is {matrix[column, row]:g}"
            )
        matrix = (matrix + matrix.T) / 2
        lowest, highest = np.linalg.eigvalsh(matrix)[[0, -1]].tolist()
        if lowest <= 0:
            raise MaterialError(
                f"stiffness has the eigenvalue {lowest:g} Pa: all must be above 0, so that the material "
                "resists every strain"
            )
        if not (lowest > 1e-9 * highest and lowest >= SMALLEST and highest < LARGEST):
            raise MaterialError(
                f"stiffness has eigenvalues from {lowest:g} to {highest:g} Pa: they must lie from "
                f"{SMALLEST:g} to {LARGEST:g}, and within a factor of 1e9"
            )
        matrix.flags.writeable = False
        object.__setattr__(self, "matrix", matrix)

    def __repr__(self) -> str:
        return f"Stiffness({self.symmetry()}, up to {np.abs(self.matrix).max():g} Pa)"

    @classmethod
    def isotropic(cls, young: float, poisson: float) -> Stiffness:
        """Return an isotropic stiffness from its 2 constants (thesis eq. 2.35).

        Args:
            young: Young's modulus [Pa], above 0.
            poisson: Poisson's ratio, above -1 and below 0.5.
        """
        nu = _as_ratio(poisson, "poisson")
        E = as_positive(young, "young", "Pa")
        return cls.orthotropic((E,) * 3, (nu,) * 3, (E / (2 * (1 + nu)),) * 3)

    @classmethod
    def one_axis(
        cls,
        young_along: float,
        young_across: float,
        poisson_along: float,
        poisson_across: float,
        shear_along: float,
    ) -> Stiffness:
        """Return a stiffness with rotational symmetry about x from its 5 constants (thesis 2.4.2).

        Wood is an example.

        Args:
            young_along, young_across: Young's moduli along and across x [Pa].
            poisson_along: Poisson's ratio for tension along x and contraction across x.
            poisson_across: Poisson's ratio for tension and contraction both across x.
            shear_along: shear modulus of planes through x [Pa]. The shear modulus of the plane across x is
                E / (2 (1 + nu)), with E = `young_across` and nu = `poisson_across`.
        """
        shear_across = as_positive(young_across, "young_across", "Pa") / (
            2 * (1 + _as_ratio(poisson_across, "poisson_across", 1.0))
        )
        return cls.orthotropic(
            (young_along, young_across, young_across),
            (poisson_across, poisson_along, poisson_along),
            (shear_across, shear_along, shear_along),
        )

    @classmethod
    def orthotropic(
        cls, young: Sequence[float], poisson: Sequence[float], shear: Sequence[float]
    ) -> Stiffness:
        """Return a stiffness with three orthogonal planes of symmetry from its 9 constants (thesis 2.4.1).

        Args:
            young: Young's moduli along x, y, z [Pa].
            poisson: Poisson's ratios nu_yz, nu_xz, nu_xy, for tension along the first axis and contraction
                along the second axis.
            shear: shear moduli G_yz, G_xz, G_xy [Pa].
        """
        moduli = as_array(young, "young", (3,), "Pa")
        ratios = as_array(poisson, "poisson", (3,))
        shears = as_array(shear, "shear", (3,), "Pa")
        for name, values in (("young", moduli), ("shear", shears)):
            if values.min() <= 0:
                raise MaterialError(f"{name} is {values.tolist()}: it must be above 0 Pa along every axis")
        compliance = np.diag(1 / np.concatenate([moduli, shears]))
        for (a, b), ratio in zip(((1, 2), (0, 2), (0, 1)), ratios, strict=True):
            compliance[a, b] = compliance[b, a] = -ratio / moduli[a]
        try:
            return cls(np.asarray(np.linalg.inv(compliance), dtype=np.float64))
        except np.linalg.LinAlgError:
            raise MaterialError(f"poisson is {ratios.tolist()}: no material has such ratios") from None

    @classmethod
    def one_plane(cls, constants: Sequence[float]) -> Stiffness:
        """Return a stiffness with one plane of symmetry, xy, from its 13 constants (thesis 2.4.1).

        Args:
            constants: independent entries of the matrix [Pa], row by row from the diagonal: c11, c12, c13,
                c16, c22, c23, c26, c33, c36, c44, c45, c55, c66.
        """
        values = as_array(constants, "constants", (13,), "Pa")
        matrix = np.zeros((6, 6))
        rows, columns = np.array(ONE_PLANE).T
        matrix[rows, columns] = matrix[columns, rows] = values
        return cls(matrix)

    @classmethod
    def from_thesis(cls, matrix: ArrayLike) -> Stiffness:
        """Convert the matrix of thesis eq. 2.25, with order xx, yy, zz, xy, xz, yz and tensor shear strain.

        Args:
            matrix: (6, 6) [Pa].
        """
        rows = as_array(matrix, "stiffness", (6, 6), "Pa")[np.ix_(THESIS_ORDER, THESIS_ORDER)]
        rows[:, 3:] /= 2  # gamma = 2 eps
        return cls(rows)

    def to_thesis(self) -> Floats:
        """Return the matrix of thesis eq. 2.25, (6, 6) [Pa].

        With tensor shear strain, this matrix is in general not symmetric.
        """
        rows = self.matrix.copy()
        rows[:, 3:] *= 2
        return np.asarray(rows[np.ix_(THESIS_ORDER, THESIS_ORDER)])

    @property
    def tensor(self) -> Floats:
        """Stiffness tensor c_ijkl, with stress_ij = c_ijkl strain_kl, (3, 3, 3, 3) [Pa]."""
        index = np.zeros((3, 3), dtype=int)
        for number, (a, b) in enumerate(PAIRS):
            index[a, b] = index[b, a] = number
        return np.asarray(self.matrix[index[:, :, None, None], index])

    @property
    def compliance(self) -> Floats:
        """Compliance, the inverse of `matrix` (thesis eq. 2.23), (6, 6) [1/Pa].

        The compliance maps stress to strain, in Voigt's order with engineering shear. For an orthotropic
        material, the diagonal contains 1 / E and 1 / G.
        """
        return np.asarray(np.linalg.inv(self.matrix))

    def rotated(self, rotation: ArrayLike) -> Stiffness:
        """Return the stiffness of the rotated material.

        Args:
            rotation: matrix (3, 3) or quaternion (x, y, z, w).
        """
        return Stiffness(rotate_stiffness(self.matrix, as_rotation(rotation)[None])[0])

    def young_along(self, direction: ArrayLike) -> float:
        """Return the Young's modulus of a bar that is cut along `direction` [Pa].

        Args:
            direction: axis of the bar, (3,), of any length except zero.
        """
        n = as_array(direction, "direction", (3,))
        length = float(np.linalg.norm(n))
        if length == 0.0:
            raise MaterialError("direction is zero: pass the axis of the bar")
        n = n / length
        pull = np.array([n[a] * n[b] for a, b in PAIRS])
        strain = np.linalg.solve(self.matrix, pull)  # engineering shear is twice the tensor shear
        return float(1 / (pull @ strain))

    def symmetry(self, tolerance: float = 1e-6) -> str:
        """Return the name of the symmetry in these axes: "isotropic", "one axis" (x), "orthotropic",
        "one plane" (xy) or "none".

        Args:
            tolerance: largest difference that counts as zero, relative to the largest entry.
        """
        c = self.matrix
        small = tolerance * np.abs(c).max()

        def vanish(*entries: float) -> bool:
            return bool(np.abs(entries).max() <= small)

        if not vanish(*c[:3, 3], *c[:3, 4], c[3, 5], c[4, 5]):
            return "none"
        if not vanish(*c[:3, 5], c[3, 4]):
            return "one plane"
        round_x = c[1, 1] - c[2, 2], c[0, 1] - c[0, 2], c[4, 4] - c[5, 5], c[3, 3] - (c[1, 1] - c[1, 2]) / 2
        if not vanish(*round_x):
            return "orthotropic"
        if not vanish(c[0, 0] - c[1, 1], c[0, 1] - c[1, 2], c[3, 3] - c[4, 4]):
            return "one axis"
        return "isotropic"
