"""The patch test: the remaining error is of second order, and inner vertices have no force."""

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Result, Results, Verdict, section_of
from lab.experiments.patch_test import TETRAHEDRAL

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["patch-test"]


def test_laws_on_tetrahedra_pass_and_springs_do_not():
    rows = list(quick_results(EXPERIMENT.name).rows)
    results = Results(tuple(rows))
    for law in TETRAHEDRAL:
        numbers = results.one(law=law)
        assert max(numbers["inside"]) < 1e-9  # faces of neighbours cancel, at any strain
        np.testing.assert_allclose(
            numbers["surface"][2] / np.array(numbers["surface"]), [100, 10, 1], rtol=0.1
        )
    springs = results.one(law="springs")
    assert min(springs["surface"]) > 0.3  # there is no nu and no shear modulus to ask for
    assert min(springs["inside"]) > 0.1
    (finding,) = section_of(EXPERIMENT, results).findings
    assert finding.verdict is Verdict.PARTLY
    solid = [row for row in rows if row.point["law"] in TETRAHEDRAL]
    others = [Result(row.point, solid[0].numbers) for row in rows if row not in solid]
    (finding,) = section_of(EXPERIMENT, Results((*solid, *others))).findings
    assert finding.verdict is Verdict.AGREES

    rows[1] = Result(rows[1].point, springs)
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    assert finding.verdict is Verdict.DIFFERS
    assert rows[1].point["law"] in finding.why
