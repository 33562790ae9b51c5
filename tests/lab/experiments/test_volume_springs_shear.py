"""Figures 5.1 and 5.2: slopes compared with the linearised springs of eq. 5.2 and 5.5 in NumPy."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from lab.experiments.irregular import cube

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["fig-5.1-5.2"]


@pytest.fixture(scope="module")
def results():
    return quick_results(EXPERIMENT.name)


def edge_areas(mesh):
    """Area of the barycentric subfaces round each edge: the sum over its tetrahedra."""
    areas = {}
    for tet in mesh.tets:
        for p, q in combinations(sorted(tet.tolist()), 2):
            a, b = (mesh.vertices[v] for v in tet if v not in (p, q))
            x, y = mesh.vertices[p], mesh.vertices[q]
            middle = (x + y) / 2
            centres = [(x + y + a) / 3, (x + y + a + b) / 4, (x + y + b) / 3]
            arms = [centre - middle for centre in centres]
            face = np.cross(arms[0], arms[1]) / 2 + np.cross(arms[1], arms[2]) / 2
            areas[p, q] = areas.get((p, q), 0.0) + np.linalg.norm(face)
    return areas


def stiffness(mesh, young, poisson):
    """-df/dx at rest of springs E a / l, and of pulls E a nu dV / V0 along the edges of each tetrahedron."""
    total = np.zeros((3 * len(mesh.vertices),) * 2)
    areas = edge_areas(mesh)

    def ends(p, q):
        """Coordinates of both ends, how the length of the edge changes with them, and the length."""
        r = mesh.vertices[q] - mesh.vertices[p]
        length = np.linalg.norm(r)
        return [*range(3 * p, 3 * p + 3), *range(3 * q, 3 * q + 3)], np.append(-r, r) / length, length

    for (p, q), area in areas.items():
        rows, along, length = ends(p, q)
        total[np.ix_(rows, rows)] += young * area / length * np.outer(along, along)
    for tet in mesh.tets:
        growth = np.linalg.inv(np.column_stack([np.ones(4), mesh.vertices[tet]]))[1:].T.ravel()  # d(V / V0)
        columns = (3 * tet[:, None] + np.arange(3)).ravel()
        for p, q in combinations(sorted(tet.tolist()), 2):
            rows, along, _ = ends(p, q)
            total[np.ix_(rows, columns)] += young * areas[p, q] * poisson * np.outer(along, growth)
    return total


@pytest.mark.parametrize("seed", [None, 1])
@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_slopes_are_those_of_the_linearised_springs(results, seed, nu):
    numbers, mesh = results.one(seed=seed, poisson=nu), cube(4, seed)
    K, z = stiffness(mesh, 3e6, nu), mesh.vertices[:, 2]
    u = np.zeros_like(mesh.vertices)
    u[z > 0.4999, 0] = 1.0
    free = np.flatnonzero(np.repeat(np.abs(z) < 0.4999, 3))
    u = u.ravel()
    u[free] = np.linalg.solve(K[np.ix_(free, free)], -(K @ u)[free])
    slope = (K @ u).reshape(-1, 3)[z > 0.4999, 0].sum()
    assert numbers["shear_force"][0] / numbers["shear"][0] == pytest.approx(slope, rel=0.03)
    assert numbers["shear"][-1] == 1.0


def test_a_body_that_is_given_more_volume_pulls_together():
    """Therefore a larger nu preserves volume.

    With eq. 5.5 as printed, the volume would grow without limit.
    """
    mesh = cube(2)
    growing = (stiffness(mesh, 1.0, 0.3) - stiffness(mesh, 1.0, 0.0)) @ mesh.vertices.ravel()
    assert (growing.reshape(-1, 3) * mesh.vertices).sum() > 0  # held back by the pull inwards


def test_what_is_found(results):
    findings = {finding.claim: finding for finding in section_of(EXPERIMENT, results).findings}
    assert set(findings) == set(EXPERIMENT.claims)
    assert findings["volume-springs-shear"].verdict is Verdict.AGREES
    assert findings["volume-springs-volume"].verdict is Verdict.AGREES


def test_a_tensile_force_that_is_smaller_at_the_end_only_leaves_the_claim_open(results):
    """The thesis says "a little smaller" about the whole figure."""

    def judged(half, end):
        rows = []
        for row in results.rows:
            less = np.interp(row.numbers["shear"], [0.0, 0.5, 1.0], [half, half, end])
            without = results.one(seed=row.point["seed"], poisson=0.0)["tensile_force"]
            changed = without if row.point["poisson"] == 0.0 else (np.array(without) * (1 + less)).tolist()
            rows.append(replace(row, numbers={**row.numbers, "tensile_force": changed}))
        (found,) = (
            f
            for f in section_of(EXPERIMENT, Results(tuple(rows))).findings
            if f.claim == "volume-springs-tension"
        )
        return found

    assert judged(-0.05, -0.05).verdict is Verdict.AGREES
    assert judged(0.01, -0.05).verdict is Verdict.UNKNOWN
    assert "at the end on 2 of 2 meshes, but only on 0 at a shear of 0.5 too" in judged(0.01, -0.05).why
    assert judged(0.01, 0.02).verdict is Verdict.DIFFERS


def test_forces_of_the_other_nu_give_other_verdicts(results):
    swapped = [
        replace(row, point={**row.point, "poisson": 0.3 - row.point["poisson"]}) for row in results.rows
    ]
    findings = {f.claim: f for f in section_of(EXPERIMENT, Results(tuple(swapped))).findings}
    for claim in ("volume", "drop", "tension", "rise"):
        assert findings[f"volume-springs-{claim}"].verdict is Verdict.DIFFERS
        assert findings[f"volume-springs-{claim}"].why


def test_meshes_of_two_minds_leave_it_open(results):
    rows = list(results.rows)
    rows += [
        replace(row, point={**row.point, "seed": 2, "poisson": 0.3 - row.point["poisson"]})
        for row in rows
        if row.point["seed"] == 1
    ]
    findings = section_of(EXPERIMENT, Results(tuple(rows))).findings
    assert findings[0].verdict is Verdict.UNKNOWN
    assert "1 of 2 meshes" in findings[0].why
