"""Linear elasticity by scikit-fem, a finite element code that shares no code with this package."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.end_loads import EndLoad, ends
from lab.experiments.sparse_gradient import Floats
from lab.experiments.statics import Mask, factorised
from taichi_soft import Material, TetMesh


class FiniteElements:
    """Finite elements on the tetrahedra of the same mesh, with linear or quadratic displacements."""

    def __init__(self, mesh: TetMesh, material: Material, *, quadratic: bool = False) -> None:
        """Assemble the stiffness matrix; `quadratic` elements have ten nodes instead of four."""
        from skfem import Basis, ElementTetP1, ElementTetP2, ElementVector, MeshTet
        from skfem.models.elasticity import lame_parameters, linear_elasticity

        points, tets = (np.ascontiguousarray(rows.T) for rows in (mesh.vertices, mesh.tets.astype(np.int64)))
        self._mesh, self._quadratic = mesh, quadratic
        self._skfem_mesh = MeshTet(points, tets)
        self._element = ElementVector(ElementTetP2() if quadratic else ElementTetP1())
        self._basis = Basis(self._skfem_mesh, self._element)
        form = linear_elasticity(*lame_parameters(material.young, material.poisson))
        self._stiffness = form.assemble(self._basis).tocsr()
        self._solvers: dict[bytes, Any] = {}

    def solve(self, load: EndLoad) -> tuple[float, Floats]:
        """Return the stiffness (see `EndLoad.stiffness`) and the displacements of vertices, (n, 3) [m]."""
        held, u = self._held(load)
        pull = self._pull(load)
        free = ~held
        key = held.tobytes()
        if key not in self._solvers:
            self._solvers[key] = factorised(self._stiffness[free][:, free])
        u[free] = self._solvers[key]((pull - self._stiffness @ u)[free])
        work = float(u @ self._stiffness @ u)
        stiffness = load.amplitude**2 / work if load.traction.any() else work / load.amplitude**2
        return stiffness, np.asarray(u[self._basis.nodal_dofs].T)

    def _held(self, load: EndLoad) -> tuple[Mask, Floats]:
        """Return the mask of prescribed degrees of freedom, and their displacements."""
        held, u = np.zeros(self._basis.N, bool), np.zeros(self._basis.N)
        driven, nodal = load.loading.driven, self._basis.nodal_dofs.T
        held[nodal] = driven
        u[nodal] = np.where(driven, load.loading.displacement, 0.0)
        if self._quadratic:  # the midpoint of an edge follows its ends if both are prescribed
            first, second = self._skfem_mesh.edges
            middle = self._basis.edge_dofs.T
            held[middle] = driven[first] & driven[second]
            u[middle] = np.where(held[middle], (u[nodal[first]] + u[nodal[second]]) / 2, 0.0)
        return held, u

    def _pull(self, load: EndLoad) -> Floats:
        """Return the force on each degree of freedom due to the traction on the right end [N]."""
        from skfem import FacetBasis, LinearForm

        if not load.traction.any():
            return np.zeros(self._basis.N)
        _, right = ends(self._mesh)
        far = float(self._mesh.vertices[right, 0].max())
        facets = self._skfem_mesh.facets_satisfying(lambda x: np.abs(x[0] - far) < 1e-9, boundaries_only=True)

        def work(v: Any, _: Any) -> Any:
            return sum(load.traction[axis] * v[axis] for axis in range(3))

        basis = FacetBasis(self._skfem_mesh, self._element, facets=facets)
        return np.asarray(LinearForm(work).assemble(basis))
