"""Errors decrease with the size of the cells."""

from copy import deepcopy

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["mesh-convergence"]


def test_errors_of_tetrahedra_fall_with_second_order_and_those_of_springs_stay():
    rows = list(quick_results(EXPERIMENT.name).rows)
    by_law = {}
    for row in rows:
        by_law.setdefault(row.point["law"], {})[row.point["cells"]] = row.numbers
    for load in ("torsion", "bending"):
        ours, theirs = by_law["virial"], by_law["linear finite elements"]
        assert np.log(ours[3][load] / ours[6][load]) / np.log(2) == pytest.approx(2, abs=0.3)
        assert all(ours[cells][load] == pytest.approx(theirs[cells][load], abs=1e-3) for cells in ours)
        assert abs(by_law["springs"][6][load]) > 0.2
    assert max(abs(numbers["tension"]) for numbers in by_law["virial"].values()) < 5e-4
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    assert finding.verdict is Verdict.PARTLY  # springs go elsewhere
    alike = deepcopy(rows)
    for row in alike:
        if row.point["law"] == "springs":
            row.numbers.update(by_law["virial"][row.point["cells"]])
    (finding,) = section_of(EXPERIMENT, Results(tuple(alike))).findings
    assert finding.verdict is Verdict.AGREES

    stuck = deepcopy(rows)
    for row in stuck:
        if row.point == {"law": "virial", "strain": None, "cells": 6}:
            row.numbers["bending"] = 0.2
    (finding,) = section_of(EXPERIMENT, Results(tuple(stuck))).findings
    assert finding.verdict is Verdict.DIFFERS
    assert finding.why.startswith("model")
