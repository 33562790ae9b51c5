"""What is timed in chapter 4: the physics against closed forms, and verdicts for given times."""

import numpy as np
import pytest
from quick import altered, quick_results, verdicts

from lab.experiments import Effort, Verdict
from lab.experiments.cmpm_drop import FRAME, FRAMES
from lab.experiments.implicit_step import points


def test_the_best_fitting_plane_is_judged_by_time_step_and_growth():
    results = quick_results("best-fitting-plane-cost")
    numbers = results.one(mesh="another uneven block")
    assert numbers["growth_rate"]["best_fitting_plane"] > 50 * numbers["growth_rate"]["cmpm"]
    assert all(n["step"]["best_fitting_plane"] < n["step"]["cmpm"] for _, n in results.where())

    def judged(ratio, step):
        def change(point, numbers):
            return {**numbers, "ratio": ratio, "step": {"cmpm": 1.0, "best_fitting_plane": step}}

        return verdicts("best-fitting-plane-cost", altered(results, change))["best-fitting-plane-cost"]

    assert judged(5.0, 0.8) is Verdict.AGREES
    assert judged(0.9, 0.8) is Verdict.DIFFERS
    assert judged(5.0, 1.1) is Verdict.DIFFERS


def test_implicit_steps_follow_a_fall_that_leapfrog_cannot_make():
    """Free fall by implicit Euler is z0 - g h^2 n (n + 1) / 2, by leapfrog z0 - g t^2 / 2."""
    results = quick_results("implicit-step")
    g, t = 9.80665, FRAME * np.arange(1, 5)
    leapfrog = results.one(integrator="leapfrog", factor=0.9)
    np.testing.assert_allclose(leapfrog["height"][:4], 1.5 - g * t**2 / 2, atol=1e-3)
    implicit = results.one(integrator="implicit_euler", run="fall", factor=100.0)
    n = np.round(t / implicit["step"])
    np.testing.assert_allclose(
        implicit["height"][:4], 1.5 - g * implicit["step"] ** 2 * n * (n + 1) / 2, atol=1e-3
    )
    assert implicit["step"] == pytest.approx(1e-2, rel=0.05)
    assert results.one(integrator="leapfrog", factor=1.3)["frozen"]
    assert len(results.one(run="rates")["explicit"]) == FRAMES
    assert verdicts("implicit-step", results)["implicit-step"] is Verdict.PARTLY  # it does not bounce
    rises = results.one(integrator="leapfrog", factor=0.9)["height"]

    def judged(gain, frozen, height):
        def change(point, numbers):
            if point["run"] == "rates":
                return {"explicit": [gain] * FRAMES, "implicit": [1.0] * FRAMES}
            if point["factor"] == 100.0:
                return {**numbers, "frozen": frozen, "height": [*numbers["height"][:5], *height]}
            return numbers

        return list(verdicts("implicit-step", altered(results, change)).values())

    assert judged(25.0, False, rises[5:]) == [Verdict.AGREES, Verdict.AGREES]
    assert judged(25.0, False, [1.0] * 7) == [Verdict.PARTLY, Verdict.AGREES]
    assert judged(5.0, True, rises[5:]) == [Verdict.DIFFERS, Verdict.DIFFERS]
    assert {point["resolution"] for point in points(Effort.FULL)} == {5}
