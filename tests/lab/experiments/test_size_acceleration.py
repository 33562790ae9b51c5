"""Accelerations for twice the size: dimensional analysis, and verdicts that depend on the numbers."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import Verdict
from taichi_soft import Material, internal_forces, sphere

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

NAME = "size-acceleration"


@pytest.mark.parametrize("size", [2.0, 4.0])
def test_forces_grow_with_the_area_masses_with_the_volume(size):
    results = quick_results(NAME)
    small, large = (results.one(law="virial", size=each) for each in (1.0, size))
    assert large["force"] / small["force"] == pytest.approx(size**2, rel=1e-9)
    assert large["mass"] / small["mass"] == pytest.approx(size**3, rel=1e-6)
    assert small["acceleration"] / large["acceleration"] == pytest.approx(size, rel=1e-3)


def test_accelerations_are_forces_over_the_masses_of_the_particles():
    """A particle has a quarter of the mass of each tetrahedron around it."""
    numbers = quick_results(NAME).one(law="virial", size=1.0)
    mesh = sphere(1.0, 3)
    masses = np.zeros(len(mesh.vertices))
    corners = mesh.vertices[mesh.tets]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    np.add.at(masses, mesh.tets, 1000.0 * volumes[:, None] / 4)
    stretched = mesh.vertices * (1.1, 1.0, 0.9)
    forces = internal_forces(mesh, Material(1e6, 0.3, 1000.0), stretched, law="virial")
    accelerations = np.linalg.norm(forces, axis=1) / masses
    assert numbers["mass"] == pytest.approx(masses.sum())
    assert numbers["acceleration"] == pytest.approx(np.sqrt((accelerations**2).mean()), rel=1e-3)


def test_the_verdict_follows_the_ratio():
    results = quick_results(NAME)
    assert verdicts(NAME, results) == {NAME: Verdict.DIFFERS}
    assert "accelerations are 2 times smaller; forces are 4 times larger, masses 8 times" in (
        findings(NAME, results)[NAME].measured
    )

    def cubic(point, numbers):
        return {**numbers, "acceleration": point["size"] ** -3}

    assert verdicts(NAME, altered(results, cubic)) == {NAME: Verdict.AGREES}
