"""A pulse in a bar: its speed is sqrt(E / rho) with tetrahedra, but not with springs."""

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import Result, Results, Verdict, section_of
from lab.experiments.dynamics import WAVE_SPEED

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

SPEED = np.sqrt(1e6 / 1000)


def test_a_pulse_runs_at_the_root_of_modulus_over_density():
    measured = [(row.point, row.numbers) for row in quick_results(WAVE_SPEED.name).rows]
    known = {(p["law"], p["poisson"]): n for p, n in measured}
    for poisson in (0.0, 0.3):
        assert known["virial", poisson]["speed"] == pytest.approx(SPEED, rel=5e-3)
    assert known["springs", 0.3]["speed"] < 0.9 * SPEED
    # The bell at the end starts with 8 mm, and half of it arrives where it should be, still a bell.
    waves = known["virial", 0.3]
    places, last, time = np.array(waves["places"]), np.array(waves["profiles"][-1]), waves["times"][-1]
    expected = 4e-3 * np.exp(-0.5 * ((places - SPEED * time) / 0.8) ** 2)
    assert np.abs(last - expected).max() < 2e-4

    assert _verdict(measured) is Verdict.PARTLY
    alike = [(p, {**n, "speed": SPEED}) for p, n in measured]
    assert _verdict(alike) is Verdict.AGREES
    slower = [(p, {**n, "speed": 0.97 * n["speed"]}) if p["law"] == "face" else (p, n) for p, n in measured]
    assert _verdict(slower) is Verdict.DIFFERS


def _verdict(measured):
    (finding,) = section_of(WAVE_SPEED, Results(tuple(Result(p, n) for p, n in measured))).findings
    assert finding.verdict is not Verdict.DIFFERS or finding.why.startswith("the model")
    return finding.verdict
