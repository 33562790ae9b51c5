"""Implicit Euler for tetrahedra: free fall compared with closed forms, and verdicts for given times."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import Effort, Verdict
from lab.experiments.cmpm_drop import FRAME
from lab.experiments.implicit_tetrahedra import BODIES, THESIS, points

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

NAME = "implicit-tetrahedra"


def test_falls_are_those_of_the_integrators():
    """The heights are z0 - g h^2 n (n + 1) / 2 with implicit Euler, and z0 - g t^2 / 2 with leapfrog."""
    g, t = 9.80665, FRAME * np.arange(1, 5)
    for point, numbers in quick_results(NAME).where():
        h = numbers["step"]
        n = np.round(t / h)
        implicit = point["integrator"] == "implicit_euler"
        fallen = g * h**2 * n * (n + 1) / 2 if implicit else g * t**2 / 2
        np.testing.assert_allclose(numbers["height"][:4], 1.5 - fallen, atol=2e-3)


def test_a_full_report_has_every_body_and_step():
    full = [(p["body"], p["factor"]) for p in points(Effort.FULL) if p["integrator"] == "implicit_euler"]
    assert full == [(name, factor) for name, (_, factors) in BODIES.items() for factor in factors]


def test_the_verdict_follows_gain_and_bounce():
    results = quick_results(NAME)

    def judged(gain, keeps_bounce):
        def change(point, numbers):
            reference = results.one(body=point["body"], integrator="leapfrog")
            if point["integrator"] == "leapfrog":
                return numbers
            times = {"explicit": gain[point["body"]], "implicit": 1.0}
            return {**(reference if keeps_bounce else numbers), "step": numbers["step"], **times}

        return altered(results, change)

    slow = {THESIS: 0.5, "stiff": 1.4}
    assert verdicts(NAME, judged(slow, True)) == {NAME: Verdict.AGREES}
    fast = judged({**slow, "stiff": 5.0}, True)
    assert verdicts(NAME, fast) == {NAME: Verdict.PARTLY}
    assert "does not hold for the stiff sphere" in findings(NAME, fast)[NAME].why
    assert "5 times faster with a bounce kept" in findings(NAME, fast)[NAME].why
    assert verdicts(NAME, judged({**slow, THESIS: 5.0}, True)) == {NAME: Verdict.DIFFERS}
    assert verdicts(NAME, judged({THESIS: 5.0, "stiff": 5.0}, False)) == {NAME: Verdict.AGREES}
