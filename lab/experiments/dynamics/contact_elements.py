"""Contact of a body with a rigid plane without friction, by finite elements (scikit-fem), small strain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Material, TetMesh

Floats = NDArray[np.float64]


def contact_forces(
    mesh: TetMesh, material: Material, held: NDArray[np.int64], lifts: list[float]
) -> list[float]:
    """Return the force on a plane for each height of the plane above the lowest vertex [N].

    The plane exerts only pressure, and no vertex can lie below the plane. First, the displacements due to a
    unit force on each vertex near the plane are computed. Given these displacements, the state of least
    energy is the solution of a least-squares problem with non-negative forces.
    Args:
        held: indices of fixed vertices.
        lifts: heights of the plane above the lowest vertex [m].
    """
    from scipy.optimize import nnls
    from scipy.sparse.linalg import splu
    from skfem import Basis, ElementTetP1, ElementVector, MeshTet
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    arrays = (np.ascontiguousarray(rows.T) for rows in (mesh.vertices, mesh.tets))
    elements = Basis(MeshTet(*arrays), ElementVector(ElementTetP1()))
    young, poisson = (float(np.unique(getattr(material, name))[0]) for name in ("young", "poisson"))
    stiffness = linear_elasticity(*lame_parameters(young, poisson)).assemble(elements).tocsc()
    number = elements.nodal_dofs.T  # (n, 3)
    free = np.setdiff1d(np.arange(elements.N), number[held].ravel())
    height = mesh.vertices[:, 2] - mesh.vertices[:, 2].min()
    near = np.flatnonzero(height < max(lifts))
    rows = np.searchsorted(free, number[near, 2])
    units = np.zeros((len(free), len(near)))
    units[rows, np.arange(len(near))] = 1.0
    moved = splu(stiffness[free][:, free]).solve(units)[rows]  # [m/N]
    root = np.linalg.cholesky((moved + moved.T) / 2)
    return [float(nnls(root.T, np.linalg.solve(root, lift - height[near]))[0].sum()) for lift in lifts]
