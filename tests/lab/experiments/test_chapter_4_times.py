"""Timings of chapter 4: the physics compared with closed forms, and verdicts for given times."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import Effort, Verdict
from lab.experiments.cmpm_drop import FRAME, FRAMES
from lab.experiments.implicit_step import points

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]


def test_the_best_fitting_plane_is_judged_by_time_step_and_growth():
    results = quick_results("best-fitting-plane-cost")
    numbers = results.one(mesh="another uneven block")
    assert numbers["growth_rate"]["best_fitting_plane"] > 50 * numbers["growth_rate"]["cmpm"]
    assert all(n["step"]["best_fitting_plane"] < n["step"]["cmpm"] for _, n in results.where())

    def judged(ratio, step):
        def change(point, numbers):
            steps = {"cmpm": 1.0, "best_fitting_plane": step, "split_ring_plane": 1.0}
            ratios = {"best_fitting_plane": ratio, "split_ring_plane": 1.0}
            return {**numbers, "ratio": ratios, "step": steps}

        return verdicts("best-fitting-plane-cost", altered(results, change))["best-fitting-plane-cost"]

    assert judged(5.0, 0.8) is Verdict.AGREES
    assert judged(0.9, 0.8) is Verdict.DIFFERS
    assert judged(5.0, 1.1) is Verdict.DIFFERS


def test_the_split_ring_is_judged_beside_the_best_fitting_plane():
    results = quick_results("best-fitting-plane-cost")

    def judged(ratio, step, growth, only=None):
        def change(point, numbers):
            if only is not None and point["mesh"] != only:
                return numbers
            steps = {"cmpm": 1.0, "best_fitting_plane": 1.0, "split_ring_plane": step}
            ratios = {"best_fitting_plane": 5.0, "split_ring_plane": ratio}
            rates = {"cmpm": 1.0, "best_fitting_plane": 10.0, "split_ring_plane": growth}
            return {**numbers, "ratio": ratios, "step": steps, "growth_rate": rates}

        changed = altered(altered(results, change) if only is None else good, change)
        return verdicts("best-fitting-plane-cost", changed)["split-ring-cost"]

    def well(point, numbers):
        steps = {"cmpm": 1.0, "best_fitting_plane": 1.0, "split_ring_plane": 1.0}
        ratios = {"best_fitting_plane": 5.0, "split_ring_plane": 1.0}
        rates = {"cmpm": 1.0, "best_fitting_plane": 10.0, "split_ring_plane": 2.0}
        return {**numbers, "ratio": ratios, "step": steps, "growth_rate": rates}

    good = altered(results, well)
    assert judged(1.0, 0.95, 9.0) is Verdict.AGREES
    assert judged(6.0, 0.95, 9.0) is Verdict.DIFFERS
    assert judged(1.0, 0.8, 9.0) is Verdict.DIFFERS
    assert judged(1.0, 0.95, 11.0) is Verdict.DIFFERS
    assert judged(1.0, 0.8, 9.0, only="ball") is Verdict.PARTLY


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
    assert "Tolerance: 13.3 to 45 times" in findings("implicit-step", results)["implicit-rate"].measured
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
    assert judged(25.0, False, [1.0] * 7) == [Verdict.PARTLY, Verdict.PARTLY]
    assert judged(13.0, False, rises[5:]) == [Verdict.AGREES, Verdict.DIFFERS]
    assert judged(5.0, True, rises[5:]) == [Verdict.DIFFERS, Verdict.DIFFERS]
    assert {point["resolution"] for point in points(Effort.FULL)} == {5}
