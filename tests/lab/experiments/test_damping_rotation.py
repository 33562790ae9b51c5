"""Damping that brakes rotation, and damping that does not."""

import copy

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from lab.experiments.damping_rotation import body_mesh, rate

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["damping-rotation"]


@pytest.fixture(scope="module")
def rows():
    return list(quick_results(EXPERIMENT.name).rows)


def finding_of(rows):
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    return finding


def test_edge_damping_keeps_the_spin_and_the_other_takes_it_as_a_rigid_body_s_power_says(rows):
    """Power of the damping of a rigid body that turns at 1 rad/s, over its energy, halved."""
    mesh = body_mesh("cube")
    x = mesh.vertices - mesh.vertices.mean(axis=0)
    v = np.cross((0, 0, 1.0), x)[mesh.tets]
    power = 10.0 * ((v - v.mean(axis=1, keepdims=True)) ** 2).sum()
    masses = np.zeros(len(x))
    np.add.at(masses, mesh.tets, 1000.0 * mesh.volumes[:, None] / 4)
    energy = 0.5 * masses @ (np.cross((0, 0, 1.0), x) ** 2).sum(axis=1)
    edge, mean = (row.numbers for row in rows)
    assert rate(mean) == pytest.approx(power / (2 * energy), rel=0.01)
    assert mean["left"] == pytest.approx(np.exp(-power / (2 * energy) * np.array(mean["time"])), rel=0.01)
    assert edge["left"] == pytest.approx([1.0] * len(edge["left"]), abs=1e-5)


def test_the_verdict_follows_the_numbers(rows):
    assert finding_of(rows).verdict is Verdict.AGREES
    changes = ((0, "left", 0.5, "edge damping brakes"), (1, "left", 1.0, "does not brake"))
    for row, key, value, why in changes:
        other = copy.deepcopy(rows)
        other[row].numbers[key] = [value] * len(other[row].numbers[key])
        assert finding_of(other).verdict is Verdict.DIFFERS
        assert why in finding_of(other).why
    other = copy.deepcopy(rows)
    other[1].numbers["expected"] *= 2
    assert "not that of a rigid body" in finding_of(other).why
