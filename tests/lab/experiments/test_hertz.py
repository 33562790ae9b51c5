"""A sphere on a plane: its mesh, finite elements with contact, and forces compared with Hertz's formula."""

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import Result, Results, Verdict, section_of
from lab.experiments.dynamics import HERTZ
from lab.experiments.dynamics.contact_elements import contact_forces
from lab.experiments.dynamics.pressed_sphere import DEPTHS, RADIUS, graded_sphere
from taichi_soft import Material, box

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

HERTZ_FORCES = 4 / 3 * 1e6 / (1 - 0.3**2) * np.sqrt(RADIUS) * (RADIUS * np.array(DEPTHS)) ** 1.5


def test_a_graded_sphere_is_a_sphere_and_finer_below():
    mesh = graded_sphere(4, 0.6)
    surface = np.unique(mesh.surface)
    assert np.linalg.norm(mesh.vertices[surface], axis=1) == pytest.approx(RADIUS)
    below, above = (np.linalg.norm(mesh.vertices - (0, 0, z), axis=1) for z in (-RADIUS, RADIUS))
    assert np.sort(below)[1] < 0.1 * np.sort(above)[1]


def test_finite_elements_press_a_block_flat():
    block = box((0.5, 0.5, 1.0), (2, 2, 4))
    held = np.flatnonzero(block.vertices[:, 2] > 0.5 - 1e-9)
    (force,) = contact_forces(block, Material(1e6, 0.0, 1000.0), held, [1e-3])
    assert force == pytest.approx(1e6 * 0.25 * 1e-3)


def test_tetrahedra_press_back_as_hertz_says_and_springs_do_not():
    measured = [(row.point, row.numbers) for row in quick_results(HERTZ.name).rows]
    known = {(p["law"], p["grading"]): np.array(n["forces"]) / HERTZ_FORCES for p, n in measured}
    assert known["virial", 0.6] == pytest.approx(1.0, abs=0.09)
    assert known["virial", 0.6][0] == pytest.approx(known["finite elements", 0.6][0], rel=0.02)
    assert np.all(known["springs", 0.6] < 0.7)
    assert np.ptp(known["finite elements", 0.0]) > 4 * np.ptp(known["finite elements", 0.6])
    assert _finding(measured).verdict is Verdict.PARTLY
    assert "springs" in _finding(measured).why
    like = [(p, {**n, "forces": HERTZ_FORCES.tolist()} if p["law"] == "springs" else n) for p, n in measured]
    assert _finding(like).verdict is Verdict.AGREES

    def changed(law, factors):
        return [
            (p, {**n, "forces": list(np.array(n["forces"]) * factors)} if p["law"] == law else n)
            for p, n in measured
        ]

    harder = _finding(changed("virial", 1.2))
    assert harder.verdict is Verdict.DIFFERS
    assert harder.why.startswith("the model")
    both = [(p, {**n, "forces": [1.2 * f for f in n["forces"]]}) for p, n in measured]
    assert _finding(both).verdict is Verdict.DIFFERS
    assert _finding(both).why.startswith("the mesh")


def _finding(measured):
    (finding,) = section_of(HERTZ, Results(tuple(Result(p, n) for p, n in measured))).findings
    return finding
