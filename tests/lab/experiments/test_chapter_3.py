"""Decay, waves, stability and orders: compared with closed forms, and verdicts that depend on the numbers."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import Verdict
from lab.experiments.oscillators import run_oscillators

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EULER = ("explicit_euler", "implicit_euler")


def swapped(results, one, other):
    """Return the results with the numbers of two integrators exchanged."""
    name = {one: other, other: one}

    def change(point, numbers):
        wanted = dict(point, integrator=name.get(point["integrator"], point["integrator"]))
        return results.one(**wanted)

    return altered(results, change)


def test_lazy_leapfrog_is_explicit_euler_with_its_lines_swapped():
    """Both recursions, written out in NumPy, on one damped oscillator."""
    k, b, steps = 0.04, 0.02, 40
    for name in ("explicit_euler", "lazy_leapfrog"):
        x, v = 0.01, 0.002
        u, _ = run_oscillators(name, (k,), (b,), ((x,), (v,)), steps)
        for row in u[1:, 0]:
            force = -k * x - b * v
            if name == "explicit_euler":
                x, v = x + v, v + force
            else:
                v = v + force
                x = x + v
            assert row == pytest.approx(x, abs=1e-7)


def test_orders_are_those_of_theory_and_lazy_leapfrog_is_leapfrog_but_for_its_start():
    results = quick_results("integrator-orders")
    for name, order in (("explicit_euler", 1), ("implicit_euler", 1), ("lazy_leapfrog", 1), ("leapfrog", 2)):
        errors = results.one(integrator=name, run="period")["errors"]
        assert np.log2(errors[-2] / errors[-1]) == pytest.approx(order, abs=0.1)
    theta = 2 * np.arcsin(0.05)  # of leapfrog, h w = 0.1
    lazy = np.array(results.one(integrator="lazy_leapfrog", run="long")["displacement"])
    expected = np.cos((np.arange(len(lazy)) + 0.5) * theta) / np.cos(theta / 2)
    np.testing.assert_allclose(lazy, expected, atol=2e-4)
    kicked = results.one(integrator="leapfrog", run="long")["kicked"]
    np.testing.assert_allclose(kicked, lazy, atol=1e-4)
    assert set(verdicts("integrator-orders", results).values()) == {Verdict.AGREES}
    worse = swapped(results, "explicit_euler", "lazy_leapfrog")
    assert verdicts("integrator-orders", worse)["lazy-leapfrog"] is Verdict.DIFFERS
    assert (
        verdicts("integrator-orders", swapped(results, "leapfrog", "implicit_euler"))["integrator-orders"]
        is Verdict.DIFFERS
    )


def test_decay_follows_eq_3_5_and_3_6():
    results = quick_results("fig-3.1")
    for rate in (-0.1, -0.5, -1.5):
        for name, factor in zip(EULER, (1 + rate, 1 / (1 - rate)), strict=True):
            y = results.one(integrator=name)[str(rate)]
            np.testing.assert_allclose(y, factor ** np.arange(7), atol=1e-5)
    assert set(verdicts("fig-3.1", results).values()) == {Verdict.AGREES}
    turned = findings("fig-3.1", swapped(results, *EULER)).values()
    assert {finding.verdict for finding in turned} == {Verdict.DIFFERS}
    assert all(finding.why for finding in turned)


def test_the_wave_grows_and_fades_by_the_closed_forms():
    """The modulus of 1 + i h w a step, and its inverse."""
    results = quick_results("fig-3.2")
    for angle in (0.05, 0.1):
        for name, power in zip((*EULER, "leapfrog"), (1, -1, 0), strict=True):
            amplitude = results.one(integrator=name, angle=angle)["amplitude"]
            expected = abs(1 + 1j * angle) ** (power * np.arange(len(amplitude)))
            np.testing.assert_allclose(amplitude, expected, rtol=2e-3)
            mode = results.one(integrator=name, angle=angle)["displacement"]
            eigenvalue = {1: 1 + 1j * angle, -1: 1 / (1 - 1j * angle)}.get(power)
            if eigenvalue:
                np.testing.assert_allclose(mode, (eigenvalue ** np.arange(len(mode))).real, atol=2e-3)
    assert set(verdicts("fig-3.2", results).values()) == {Verdict.AGREES}
    assert set(verdicts("fig-3.2", swapped(results, *EULER)).values()) == {Verdict.DIFFERS}


def test_regions_of_stability_are_the_circles():
    results = quick_results("fig-3.3")
    x = np.append(np.arange(-29.5, 0) / 10, 0)
    y = (np.arange(16) + 0.5) * 0.15
    z = x + 1j * y[:, None]
    for name, factor in zip(EULER, (np.abs(1 + z), np.abs(1 / (1 - z))), strict=True):
        np.testing.assert_allclose(results.one(integrator=name)["factor"], factor, atol=2e-3)
    assert verdicts("fig-3.3", results) == {"stability-regions": Verdict.AGREES}
    assert verdicts("fig-3.3", swapped(results, *EULER)) == {"stability-regions": Verdict.DIFFERS}
