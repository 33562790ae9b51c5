"""Natural frequencies: beam theory and finite elements against closed forms, and laws against both."""

from dataclasses import replace

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import Result, Results, Verdict, section_of
from lab.experiments.dynamics import FREQUENCIES
from lab.experiments.dynamics.beam_theory import (
    Beam,
    euler_bernoulli_frequency,
    timoshenko_frequency,
)
from lab.experiments.dynamics.vibration_modes import bending_frequency
from taichi_soft import Material, box

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

BEAM = Beam(2.0, 0.3, 0.2, 1e6, 0.3, 1000.0)


@pytest.mark.parametrize(("is_held", "root"), [(True, 1.8751), (False, 4.7300)])
def test_a_slender_beam_is_eulers_and_shear_slows_a_stout_one(is_held, root):
    speed = np.sqrt(1e6 * 0.3 * 0.2**3 / 12 / (1000 * 0.06))
    expected = root**2 / 4.0 * speed / (2 * np.pi)
    assert euler_bernoulli_frequency(BEAM, is_held=is_held) == pytest.approx(expected, rel=1e-4)
    thin = replace(BEAM, height=0.002)
    assert timoshenko_frequency(thin, is_held=is_held) == pytest.approx(expected / 100, rel=1e-4)
    # Shear adds E h^2 / (4 kappa G L^2) k to the cantilever's compliance, k near 1: a percent and a half.
    slower = timoshenko_frequency(BEAM, is_held=is_held) / expected
    assert 0.95 < slower < 0.995


def test_finite_elements_of_a_bar_in_tension_have_the_frequency_of_a_rod():
    rod = box((2.0, 0.2, 0.2), (20, 2, 2))
    along = rod.vertices[:, 0] / 2 + 0.5
    shape = np.zeros_like(rod.vertices)
    shape[:, 0] = np.sin(np.pi / 2 * along)
    held = np.flatnonzero(along < 1e-9)
    material = Material(1e6, 0.0, 1000.0)
    for is_lumped in (True, False):
        frequency = bending_frequency(rod, material, shape, held, is_lumped=is_lumped)
        assert frequency == pytest.approx(np.sqrt(1e6 / 1000) / 8.0, rel=2e-3)  # c / 4 L


def test_tetrahedra_swing_as_finite_elements_do_and_springs_do_not():
    some = ("virial", "springs", "finite elements")
    rows = quick_results(FREQUENCIES.name).rows
    measured = [(row.point, row.numbers) for row in rows if row.point["law"] in some]
    known = {(point["law"], point["cells"]): numbers for point, numbers in measured}
    for support in ("cantilever", "free"):
        for cells in (2, 4):
            elements = known["finite elements", cells][support]
            assert known["virial", cells][support] == pytest.approx(elements, rel=2e-3)
            assert known["springs", cells][support] < 0.85 * elements
        theory = timoshenko_frequency(BEAM, is_held=support == "cantilever")
        assert 1.15 < known["virial", 2][support] / theory < 1.25
        assert 1.04 < known["virial", 4][support] / theory < 1.08
    # The other laws on tetrahedra stand for the same numbers here: they differ by less than a thousandth.
    same = [
        ({"law": law, "cells": 2}, known["virial", 2])
        for law in ("face", "st_venant_kirchhoff", "neo_hookean")
    ]
    assert _verdicts(measured + same) == [Verdict.PARTLY, Verdict.PARTLY]  # not for springs
    slow = [({"law": "face", "cells": 2}, {**known["virial", 2], "free": 1.8}), *same[1:]]
    assert _verdicts(measured + slow) == [Verdict.PARTLY, Verdict.DIFFERS]
    unmet = [
        (point, {**n, "cantilever": n["cantilever"] * 1.05} if point["cells"] == 4 else n)
        for point, n in measured
    ]
    assert _verdicts(unmet + same) == [Verdict.DIFFERS, Verdict.PARTLY]
    alike = [
        (point, known[point["law"].replace("springs", "virial"), point["cells"]]) for point, _ in measured
    ]
    assert _verdicts(alike + same) == [Verdict.AGREES, Verdict.AGREES]


def _verdicts(measured):
    rows = tuple(Result(point, numbers) for point, numbers in measured)
    return [finding.verdict for finding in section_of(FREQUENCIES, Results(rows)).findings]
