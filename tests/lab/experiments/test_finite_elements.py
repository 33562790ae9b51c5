"""Laws compared with finite elements on the same mesh."""

from copy import deepcopy

import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["finite-elements"]
SOLID = ("virial", "face", "st_venant_kirchhoff", "neo_hookean")
LOADS = ("tension", "shear", "torsion", "bending", "block")


def test_tetrahedral_laws_agree_with_finite_elements_and_springs_do_not():
    rows = list(quick_results(EXPERIMENT.name).rows)
    for row in rows:
        ratios = [row.numbers[load]["stiffness"] / row.numbers[load]["reference"] for load in LOADS]
        if row.point["law"] in SOLID:
            assert max(abs(ratio - 1) for ratio in ratios) < 0.002, row.point
            assert max(row.numbers[load]["apart"] for load in LOADS) < 0.002, row.point
        else:
            assert max(abs(ratio - 1) for ratio in ratios) > 0.03, row.point
    assert {row.point["law"] for row in rows} > {*SOLID, "springs", "volume_springs", "cmpm", "tilted_plane"}

    section = section_of(EXPERIMENT, Results(tuple(rows)))
    assert [finding.claim for finding in section.findings] == ["finite-elements", "block-shear"]
    assert [finding.verdict for finding in section.findings] == [Verdict.AGREES, Verdict.PARTLY]
    assert "springs" in section.findings[1].why
    assert len(section.tables[0].rows) == len(rows)

    stiff = deepcopy(rows)
    stiff[2].numbers["torsion"]["stiffness"] *= 1.02
    elements, block = section_of(EXPERIMENT, Results(tuple(stiff))).findings
    assert (elements.verdict, block.verdict) == (Verdict.DIFFERS, Verdict.PARTLY)
    assert "face" in elements.why
    stiff = deepcopy(rows)
    stiff[0].numbers["block"]["stiffness"] *= 0.98
    assert section_of(EXPERIMENT, Results(tuple(stiff))).findings[1].verdict is Verdict.DIFFERS
