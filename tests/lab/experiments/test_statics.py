"""The static solver: its stiffness, its equilibria, its meshes and its reference."""

import numpy as np
import pytest

from lab.experiments.end_loads import free_ends, held_ends, theory
from lab.experiments.irregular_block import irregular_block
from lab.experiments.linear_elasticity import FiniteElements
from lab.experiments.statics import Loading, NoEquilibriumError, StaticBody
from taichi_soft import Material, edges_as_particles, force_gradient
from taichi_soft.elements.laws.springs import spring_bonds

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

MATERIAL = Material(young=1e6, poisson=0.3, density=1000.0)
BLOCK = irregular_block(2.0, 1.0, 2)


def test_the_block_fills_its_box_in_many_directions():
    assert BLOCK.volume == pytest.approx(2.0, rel=1e-12)
    assert np.allclose(np.abs(BLOCK.vertices).max(axis=0), (1.0, 0.5, 0.5))
    assert BLOCK.quality.min_dihedral.min() > 20
    directions = np.diff(BLOCK.vertices[BLOCK.edges], axis=1)[:, 0] / BLOCK.edge_lengths[:, None]
    assert (np.abs(directions).max(axis=1) < 0.999).mean() > 0.8
    assert (irregular_block(2.0, 1.0, 2).vertices == BLOCK.vertices).all()


def test_at_rest_the_stiffness_is_that_of_linear_finite_elements():
    from skfem import Basis, ElementTetP1, ElementVector, MeshTet
    from skfem.models.elasticity import linear_elasticity

    ours = StaticBody(BLOCK, MATERIAL, "virial").stiffness().toarray()
    form = linear_elasticity(MATERIAL.lame_lambda, MATERIAL.lame_mu)
    basis = Basis(MeshTet(BLOCK.vertices.T, BLOCK.tets.T.astype(np.int64)), ElementVector(ElementTetP1()))
    rows = basis.nodal_dofs.T.ravel()
    theirs = form.assemble(basis).toarray()[np.ix_(rows, rows)]
    assert np.abs(ours - theirs).max() < 1e-8 * np.abs(theirs).max()


def test_stiffness_of_a_deformed_body_is_the_exact_gradient():
    bent = BLOCK.vertices * (1.1, 0.95, 1.0) + 0.05 * np.sin(3 * BLOCK.vertices[:, [1, 2, 0]])
    law = "volume_springs"
    differences = StaticBody(BLOCK, MATERIAL, law).stiffness(bent - BLOCK.vertices).toarray()
    exact = -force_gradient(BLOCK, MATERIAL, bent, law=law).reshape(differences.shape)
    assert np.abs(differences - exact).max() < 1e-7 * np.abs(exact).max()


@pytest.mark.parametrize("law", ["cmpm", "cmpm2", "best_fitting_plane", "tilted_plane"])
def test_no_force_depends_on_a_vertex_that_the_pattern_leaves_out(law):
    body = StaticBody(BLOCK, MATERIAL, law)
    shift = np.zeros_like(BLOCK.vertices)
    vertex, h = len(shift) // 2, 1e-6
    for axis in range(3):
        shift[:] = 0
        shift[vertex, axis] = h
        column = (body.forces(-shift) - body.forces(shift)).ravel() / (2 * h)
        found = body.stiffness()[:, [3 * vertex + axis]].toarray().ravel()
        assert np.abs(column - found).max() < 1e-6 * np.abs(found).max()


def test_springs_settle_as_a_truss_written_out_in_numpy():
    load = held_ends(BLOCK)["shear"]
    k = spring_bonds(BLOCK, MATERIAL).constants[:, 1]
    truss = edges_as_particles(BLOCK, 1000.0)
    n = len(BLOCK.vertices)
    stiffness = np.zeros((n, 3, n, 3))
    for (p, q), constant in zip(truss.edges, k, strict=True):
        along = BLOCK.vertices[q] - BLOCK.vertices[p]
        block = constant * np.outer(along, along) / (along @ along)
        for a, b, sign in ((p, p, 1), (q, q, 1), (p, q, -1), (q, p, -1)):
            stiffness[a, :, b] += sign * block
    whole = stiffness.reshape(3 * n, 3 * n)
    free = ~load.loading.driven.ravel()
    u = load.loading.displacement.ravel().copy()
    u[free] = np.linalg.solve(whole[np.ix_(free, free)], -(whole @ u)[free])
    settled = StaticBody(BLOCK, MATERIAL, "springs").equilibrium(load.loading)
    assert np.abs(settled.displacement.ravel() - u).max() < 1e-3 * np.abs(u).max()
    assert load.stiffness(settled) == pytest.approx(u @ whole @ u / load.amplitude**2, rel=1e-3)


def test_reactions_balance_forces_and_large_stretch_converges():
    body = StaticBody(BLOCK, MATERIAL, "virial")
    cantilever = free_ends(BLOCK)["cantilever"]
    settled = body.equilibrium(cantilever.loading)
    assert settled.residual < 1e-7
    assert (settled.reactions + cantilever.loading.forces).sum(axis=0) == pytest.approx(0, abs=1e-6)
    far = held_ends(BLOCK)["tension"].loading
    pulled = body.equilibrium(Loading(far.driven, far.displacement * 3000, far.forces))
    assert pulled.residual < 1e-7
    assert np.ptp(pulled.displacement[:, 0]) == pytest.approx(0.6)


def test_a_body_that_nothing_holds_has_no_equilibrium():
    nothing = np.zeros_like(BLOCK.vertices)
    pull = nothing.copy()
    pull[0, 0] = 1.0
    with pytest.raises(NoEquilibriumError):
        StaticBody(BLOCK, MATERIAL, "virial").equilibrium(Loading(nothing.astype(bool), nothing, pull))


def test_quadratic_finite_elements_meet_theory():
    elements = FiniteElements(BLOCK, MATERIAL, quadratic=True)
    expected = theory(1e6, 0.3, 2.0, 1.0)
    for name, load in free_ends(BLOCK).items():
        allowed = {"torsion": 0.03, "cantilever": 0.05}.get(name, 1e-6)
        assert elements.solve(load)[0] == pytest.approx(expected[name], rel=allowed), name


def test_theory_of_a_square_bar():
    expected = theory(2.6, 0.3, 10.0, 1.0)
    assert expected["tension"] == pytest.approx(0.26)
    assert expected["shear"] == pytest.approx(0.1)
    assert expected["torsion"] == pytest.approx(0.14058 / 10, rel=1e-4)  # Timoshenko and Goodier, table of k1
    assert expected["bending"] == pytest.approx(0.26 / 12)
    assert 1 / expected["cantilever"] == pytest.approx(1000 / (3 * 2.6 / 12) + 10 * 15.3 / 13, rel=1e-9)
