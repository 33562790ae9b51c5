"""Kinetic energy accumulates if the stress has no energy."""

import copy

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from lab.experiments.energy_drift import damping_ratio, growth
from taichi_soft import Material, box, internal_forces

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["energy-drift"]


@pytest.fixture(scope="module")
def rows():
    return list(quick_results(EXPERIMENT.name).rows)


def finding_of(rows):
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    return finding


def test_energy_accumulates_but_where_the_stress_has_an_energy(rows):
    undamped = Results(tuple(row for row in rows if row.point["damping"] == 0.0))
    assert growth(undamped.one(poisson=0.1, law="virial")) > 1.5
    assert undamped.one(poisson=0.4)["frozen"]
    for conserved in (undamped.one(poisson=0.25), undamped.one(law="st_venant_kirchhoff")):
        assert np.ptp(conserved["total"]) < 0.005 * conserved["total"][0]
        assert np.ptp(conserved["kinetic"]) > 0.5 * conserved["total"][0]


def energy(mesh, positions, lam):
    """1/2 lambda (J (tr F F^T - 5) + 2) over the rest volume."""
    rest, now = (points[mesh.tets[:, 1:]] - points[mesh.tets[:, :1]] for points in (mesh.vertices, positions))
    F = np.swapaxes(now, 1, 2) @ np.linalg.inv(np.swapaxes(rest, 1, 2))
    J = np.linalg.det(F)
    return 0.5 * lam * (J * (np.einsum("mab,mab->m", F, F) - 5) + 2) @ (np.linalg.det(rest) / 6)


@pytest.mark.parametrize("poisson", [0.25, 0.1])
def test_the_virial_force_is_the_slope_of_that_energy_at_a_quarter_alone(poisson):
    mesh, random = box((1, 1, 1), (3, 3, 3)), np.random.default_rng(2)
    x = mesh.vertices + 0.05 * random.normal(size=mesh.vertices.shape)
    way = random.normal(size=x.shape)
    lam = 1e5 * poisson / ((1 + poisson) * (1 - 2 * poisson))
    slope = (energy(mesh, x + 1e-5 * way, lam) - energy(mesh, x - 1e-5 * way, lam)) / 2e-5
    work = -(internal_forces(mesh, Material(1e5, poisson, 1000.0), x) * way).sum()
    assert (abs(slope - work) < 1e-5 * abs(work)) == (poisson == 0.25)


def test_the_damping_is_read_from_the_fading():
    time = np.arange(0, 10, 0.05)
    kinetic = 7.0 * np.exp(-2 * 0.03 * (2 * np.pi * 10.0) * time / 2)
    assert damping_ratio({"time": list(time), "kinetic": list(kinetic)}) == pytest.approx(0.03)


def test_the_verdict_follows_the_numbers(rows):
    assert finding_of(rows).verdict is Verdict.AGREES
    calm = copy.deepcopy(rows)
    for row in calm:
        if row.point["damping"] == 0.0:
            row.numbers.update(frozen=False, kinetic=[1.0] * len(row.numbers["kinetic"]))
    assert finding_of(calm).verdict is Verdict.DIFFERS
    wild = copy.deepcopy(rows)
    wild[-1].numbers["frozen"] = True
    assert finding_of(wild).verdict is Verdict.DIFFERS
