"""Bars compared with closed forms."""

from copy import deepcopy

import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from taichi_soft import LAWS

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["beams"]
SOLID = ("virial", "face", "st_venant_kirchhoff", "neo_hookean")


def verdicts(rows):
    findings = section_of(EXPERIMENT, Results(tuple(rows))).findings
    return {finding.claim: finding.verdict for finding in findings}


def test_tension_and_shear_are_exact_and_torsion_and_bending_go_where_theory_says():
    rows = list(quick_results(EXPERIMENT.name).rows)
    by_cells = {row.point["cells"]: row.numbers for row in rows if row.point["law"] == "virial"}
    for load in ("torsion", "bending", "cantilever"):
        assert by_cells[2][load] > by_cells[3][load] > by_cells[4][load] > 1.05
        limit = (16 * by_cells[4][load] - 9 * by_cells[3][load]) / 7
        assert limit == pytest.approx(1, abs=0.03)
    for row in rows:
        if row.point["law"] in SOLID:
            assert row.numbers["tension"] == pytest.approx(1, abs=5e-4)
            assert row.numbers["shear"] == pytest.approx(1, abs=5e-4)
        if row.point["law"] == "quadratic finite elements":
            assert row.numbers["bending"] == pytest.approx(1, abs=1e-6)
            assert row.numbers["shear"] == pytest.approx(1, abs=1e-6)
            assert row.numbers["torsion"] == pytest.approx(1, abs=0.03)
        if row.point["law"] == "springs":
            assert 0.4 < row.numbers["tension"] < 0.6  # a uniform, isotropic network: 1/2
    claims = ("beam-tension", "beam-shear", "beam-torsion", "beam-bending")
    assert verdicts(rows) == dict.fromkeys(claims, Verdict.PARTLY)  # not for laws along edges
    whole = deepcopy(rows)
    virial = next(row.numbers for row in rows if row.point["law"] == "virial")
    for row in whole:
        if row.point["law"] in LAWS and row.point["law"] not in SOLID:
            row.numbers.update({load: virial[load] for load in ("tension", "shear", "torsion")})
    found = verdicts(whole)
    assert [found[claim] for claim in claims] == [Verdict.AGREES] * 3 + [Verdict.PARTLY]

    for load, claim in (
        ("tension", "tension"),
        ("shear", "shear"),
        ("torsion", "torsion"),
        ("cantilever", "bending"),
    ):
        changed = deepcopy(rows)
        for row in changed:
            if row.point["law"] in SOLID:
                row.numbers[load] *= 1.05
        found = verdicts(changed)
        assert [name for name, verdict in found.items() if verdict is Verdict.DIFFERS] == [f"beam-{claim}"]
