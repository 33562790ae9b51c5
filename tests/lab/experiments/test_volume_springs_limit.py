"""Growth rates in springs that preserve volume, compared with a motion integrated in NumPy."""

import numpy as np
import pytest

from lab.experiments import EXPERIMENTS, Effort, Result, Results, Verdict, section_of
from lab.experiments.irregular import cube
from taichi_soft import Material, internal_forces

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["volume-springs-limit"]


def grown(mesh, nu, damping, times, h=5e-4):
    """Return the size of a small motion at some times, by leapfrog with the damping of eq.

    3.9. The ends are fixed.
    """
    rng = np.random.default_rng(1)
    free = (np.abs(mesh.vertices[:, 2]) < 0.4999)[:, None]
    mass = 4e3 * mesh.vertex_volumes[:, None]
    x, v = mesh.vertices + 1e-9 * free * rng.normal(size=mesh.vertices.shape), np.zeros_like(mesh.vertices)
    p, q = mesh.edges.T
    sizes = []
    for step in range(round(times[-1] / h)):
        f = internal_forces(mesh, Material(3e6, nu, 4e3), x, law="volume_springs")
        n = (x[q] - x[p]) / np.linalg.norm(x[q] - x[p], axis=1, keepdims=True)
        brake = damping * n * ((v[q] - v[p]) * n).sum(axis=1, keepdims=True)
        np.add.at(f, p, brake)
        np.add.at(f, q, -brake)
        v = (v + h * f / mass) * free
        x = x + h * v
        if any(abs((step + 1) * h - t) < h / 2 for t in times):
            sizes.append(np.linalg.norm(x - mesh.vertices))
    return sizes


@pytest.mark.parametrize("damping", [0.0, 1000.0])
def test_rates_are_those_of_a_motion(damping):
    mesh = cube(3, 1)
    numbers = EXPERIMENT.measure({"seed": 1, "damping": damping, "poisson": [0.0, 0.4]})
    assert numbers["growth"][0] < 1e-6  # springs alone keep their energy
    first, last = grown(mesh, 0.4, damping, (0.1, 0.25))
    assert np.log(last / first) / 0.15 == pytest.approx(numbers["growth"][1], rel=0.15)


def verdict(growth):
    points = EXPERIMENT.points(Effort.QUICK)
    rows = [Result(p, {"growth": growth(p), "step": [1e-3] * len(p["poisson"])}) for p in points]
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    assert (finding.why == "") == (finding.verdict is Verdict.AGREES)
    return finding.verdict


def test_rates_decide():
    assert verdict(lambda p: [10.0 * (nu > 0.31) for nu in p["poisson"]]) is Verdict.AGREES
    assert verdict(lambda p: [10.0 * (nu > 0.11) for nu in p["poisson"]]) is Verdict.DIFFERS
    assert verdict(lambda p: [10.0 * (nu * 1e4 > p["damping"]) for nu in p["poisson"]]) is Verdict.UNKNOWN
