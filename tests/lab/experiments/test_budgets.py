"""Budgets of energy and momentum: their terms compared with closed forms, and their verdicts."""

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import Result, Results, Verdict, section_of
from lab.experiments.dynamics import ENERGY_BUDGET, MOMENTUM_BUDGET
from lab.experiments.dynamics.energy_budget import _damping_power, _energy_density
from taichi_soft import box

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]


@pytest.mark.parametrize("law", ["st_venant_kirchhoff", "neo_hookean"])
def test_a_small_stretch_holds_half_of_young_times_its_square(law):
    stretch = 1e-4
    deformed = np.diag([1 + stretch, 1 - 0.3 * stretch, 1 - 0.3 * stretch])[None]
    assert _energy_density(law, deformed)[0] == pytest.approx(0.5 * 1e6 * stretch**2, rel=1e-3)
    turned = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    assert _energy_density(law, turned)[0] == pytest.approx(0.0, abs=1e-9)


def test_dampers_take_power_from_growth_and_none_from_turning():
    mesh = box((1.0, 0.2, 0.2), (2, 1, 1))
    lengths = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    growing = _damping_power(mesh, mesh.vertices, 0.5 * mesh.vertices, 3.0)
    assert growing == pytest.approx(3.0 * 0.25 * (lengths**2).sum())
    turning = _damping_power(mesh, mesh.vertices, np.cross((1.0, 2.0, 3.0), mesh.vertices), 3.0)
    assert turning == pytest.approx(0.0, abs=1e-20)


def test_energy_is_where_it_should_be():
    measured = [(row.point, row.numbers) for row in quick_results(ENERGY_BUDGET.name).rows]
    keeping = [numbers for point, numbers in measured if point["law"] != "virial"]
    (virial,) = (numbers for point, numbers in measured if point["law"] == "virial")
    (undamped, damped) = (numbers for point, numbers in measured if point["law"] == "neo_hookean")
    for numbers in keeping:
        assert numbers["error"] < 1e-4 * numbers["given"]
        kept = np.array([numbers[name] for name in ("kinetic", "elastic", "place", "damped")]).sum(axis=0)
        assert np.abs(kept).max() < 1e-4 * numbers["given"]
    assert damped["damped"][-1] > 0.02 * damped["given"]
    assert virial["error"] > 1e-3 * virial["given"]
    # Falling as one stiff bar about the clamp, it would give m g L / 2 sin(a): less than 40 kg allow.
    assert 20 < undamped["given"] < 0.5 * 40 * 9.81
    assert _verdict(ENERGY_BUDGET, measured) is Verdict.PARTLY  # not for the virial law
    kept = [(p, {**n, "error": 0.0}) for p, n in measured]
    assert _verdict(ENERGY_BUDGET, kept) is Verdict.AGREES
    lost = [(p, {**n, "error": 0.01 * n["given"]} if n is undamped else n) for p, n in measured]
    assert _verdict(ENERGY_BUDGET, lost) is Verdict.DIFFERS


def test_a_free_body_keeps_its_momenta_but_under_cmpm():
    measured = [(row.point, row.numbers) for row in quick_results(MOMENTUM_BUDGET.name).rows]
    assert all(numbers["momentum"] < 2e-6 for _, numbers in measured)
    for point, numbers in measured:
        if point["law"] == "cmpm":
            assert numbers["angular_momentum"] > (0.2 if point["damping"] else 1e-3)
        else:
            assert numbers["angular_momentum"] < 2e-6
    assert _verdict(MOMENTUM_BUDGET, measured) is Verdict.PARTLY  # not for cmpm
    straight = [(p, {**n, "angular_momentum": 1e-7}) for p, n in measured]
    assert _verdict(MOMENTUM_BUDGET, straight) is Verdict.AGREES
    apart = [(p, {**n, "times": []} if p["law"] == "cmpm" else n) for p, n in straight]
    assert _verdict(MOMENTUM_BUDGET, apart) is Verdict.PARTLY
    turned = [(p, {**n, "angular_momentum": 1e-3} if p["law"] == "face" else n) for p, n in measured]
    assert _verdict(MOMENTUM_BUDGET, turned) is Verdict.DIFFERS
    broken = [(p, {**n, "times": []} if p["law"] == "face" else n) for p, n in measured]
    assert _verdict(MOMENTUM_BUDGET, broken) is Verdict.DIFFERS


def _verdict(experiment, measured):
    (finding,) = section_of(experiment, Results(tuple(Result(p, n) for p, n in measured))).findings
    return finding.verdict
