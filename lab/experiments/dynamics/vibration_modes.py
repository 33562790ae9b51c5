"""Natural frequencies of a mesh by finite elements (scikit-fem): linear tetrahedra, small strain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Material, TetMesh

Floats = NDArray[np.float64]


def bending_frequency(
    mesh: TetMesh, material: Material, shape: Floats, held: NDArray[np.int64], *, is_lumped: bool
) -> float:
    """Return the frequency of the mode that is most similar to a given shape [Hz].

    Args:
        shape: displacements of the vertices, (n, 3).
        held: indices of fixed vertices.
        is_lumped: True puts a quarter of each tetrahedron's mass at each of its vertices, as in the models of
            the thesis. False spreads the mass over the elements.
    """
    from scipy.sparse import diags
    from scipy.sparse.linalg import eigsh
    from skfem import Basis, BilinearForm, ElementTetP1, ElementVector, MeshTet
    from skfem.helpers import dot
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    elements = Basis(
        MeshTet(*(np.ascontiguousarray(rows.T) for rows in (mesh.vertices, mesh.tets))),
        ElementVector(ElementTetP1()),
    )
    young, poisson = (float(np.unique(getattr(material, name))[0]) for name in ("young", "poisson"))
    density = float(np.unique(material.density)[0])
    stiffness = linear_elasticity(*lame_parameters(young, poisson)).assemble(elements)
    mass = BilinearForm(lambda u, v, w: density * dot(u, v)).assemble(elements)
    if is_lumped:
        mass = diags(np.asarray(mass.sum(axis=1)).ravel())
    number = elements.nodal_dofs.T  # (n, 3)
    vector = np.zeros(elements.N)
    vector[number] = shape
    free = np.setdiff1d(np.arange(elements.N), number[held].ravel())
    stiffness, mass = (matrix.tocsc()[free][:, free] for matrix in (stiffness, mass))
    # A shift below all frequencies makes the matrix regular, even for a free body.
    scale = float(stiffness.diagonal().mean() / mass.diagonal().mean())
    squares, modes = eigsh(stiffness, k=9, M=mass, sigma=-1e-5 * scale, which="LM", v0=np.ones(len(free)))
    sizes = np.sqrt(np.einsum("im,im->m", modes, mass @ modes))
    likeness = np.abs(modes.T @ (mass @ vector[free])) / sizes
    return float(np.sqrt(squares[likeness.argmax()]) / (2 * np.pi))
