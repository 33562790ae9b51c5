"""The estimate of the largest stable substep: against dense eigenvalues, and against what worlds then do."""

import warnings

import numpy as np
import pytest
from step_oracle import dense, largest_step

from taichi_soft import (
    Material,
    TaichiSoftError,
    UnstableStepWarning,
    beam,
    box,
    sphere,
    stable_step,
    torus,
)
from taichi_soft.elements.laws import element_model
from taichi_soft.world.bare import bare_world

MESHES = {
    "box": box((1.0, 0.6, 0.8), (2, 1, 2)),
    "sphere": sphere(0.5, 2),
    "beam": beam(2.0, 0.4, 0.4, 1),
    "torus": torus(1.0, 0.4, 1, 8),
}
SOFT = Material(1e5, 0.2, 1000.0, damping_ratio=0.0)
VIRIAL = element_model("virial")


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("poisson", [-0.3, 0.0, 0.2, 0.45])
def test_the_limit_is_two_over_the_highest_frequency_of_the_dense_eigenproblem(name, poisson):
    material = Material(1e5, poisson, 1000.0, damping_ratio=0.0)
    K, _ = dense(MESHES[name], material)
    omega = np.sqrt(np.linalg.eigvalsh((K + K.T) / 2)[-1])
    found = stable_step(MESHES[name], material, VIRIAL)
    assert found.limit == pytest.approx(2 / omega, rel=0.1)
    assert found.period == pytest.approx(2 * np.pi / omega, rel=0.1)
    assert found.recommended < 2 / omega


@pytest.mark.parametrize("name", MESHES)
def test_stiffness_at_rest_is_symmetric_and_has_six_rigid_motions(name):
    """The stiffness is equal for both strains. The estimate assumes these properties."""
    K, _ = dense(MESHES[name], SOFT)
    exact, _ = dense(MESHES[name], SOFT, strain="exact")
    values = np.linalg.eigvalsh((K + K.T) / 2)
    np.testing.assert_allclose(K, K.T, atol=1e-6 * values[-1])
    np.testing.assert_allclose(exact, K, atol=1e-5 * values[-1])
    np.testing.assert_allclose(values[:6], 0, atol=1e-6 * values[-1])
    assert values[6] > 1e-4 * values[-1]


def test_bodies_of_uneven_material_are_limited_as_the_dense_eigenproblem_says():
    mesh = MESHES["sphere"]
    rng = np.random.default_rng(1)
    count = len(mesh.tets)
    young = rng.uniform(1e4, 1e6, count)
    material = Material(
        young, rng.uniform(-0.3, 0.4, count), rng.uniform(300, 3000, count), damping_ratio=0.0
    )
    K, _ = dense(mesh, material)
    assert stable_step(mesh, material, VIRIAL).limit == pytest.approx(
        2 / np.sqrt(np.linalg.eigvalsh((K + K.T) / 2)[-1]), rel=0.1
    )


@pytest.mark.parametrize("model", ["edge", "tet_mean"])
@pytest.mark.parametrize("damping", [5.0, 100.0, 1000.0])
def test_damping_shortens_the_limit_as_the_eigenvalues_of_the_damped_step_say(model, damping):
    mesh = box((1.0, 0.6, 0.8), (1, 1, 1))
    material = Material(1e5, 0.2, 1000.0, damping, damping_ratio=0.0)
    expected = largest_step(*dense(mesh, material, model))
    found = stable_step(mesh, material, element_model("virial", damping_model=model))
    assert found.limit == pytest.approx(expected, rel=0.1)
    assert found.limit < stable_step(mesh, SOFT, VIRIAL).limit


def test_the_limit_scales_as_size_over_the_speed_of_sound():
    """The tolerance is the rounding to five digits."""
    base = stable_step(MESHES["sphere"], SOFT, VIRIAL).limit
    assert stable_step(MESHES["sphere"].scaled(3.0), SOFT, VIRIAL).limit == pytest.approx(3 * base, rel=2e-5)
    assert stable_step(
        MESHES["sphere"], Material(4e5, 0.2, 1000.0, damping_ratio=0.0), VIRIAL
    ).limit == pytest.approx(base / 2, rel=2e-5)
    assert stable_step(
        MESHES["sphere"], Material(1e5, 0.2, 4000.0, damping_ratio=0.0), VIRIAL
    ).limit == pytest.approx(2 * base, rel=2e-5)


def test_the_stiffest_tetrahedron_is_the_one_to_blame():
    """The one of the highest frequency on its own quarter masses, in the caller's order."""
    mesh = MESHES["beam"]
    young = np.full(len(mesh.tets), 1e5)
    young[17] = 1e8
    assert stable_step(mesh, Material(young, 0.2, 1000.0, damping_ratio=0.0), VIRIAL).stiffest_tet == 17


def amplitudes(mesh, material, h, steps, seed=0):
    """Largest displacement during the run, as a multiple of that at its start; inf if the body was frozen."""
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(mesh, material)
    world.build()
    noise = 1e-4 * np.random.default_rng(seed).normal(size=mesh.vertices.shape)
    body.set_motion(mesh.vertices + noise, np.zeros_like(noise))
    largest = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for _ in range(steps // 20):
            world.step(20 * h, 20)
            if body.is_frozen:
                return np.inf
            largest = max(largest, np.abs(body.positions() - mesh.vertices).max())
    return largest / np.abs(noise).max()


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("damping", [0.0, 100.0])
def test_a_world_is_stable_below_the_limit_and_blows_up_above_it(name, damping):
    """A tenth below, small vibration stays small; 15 % above, it grows a hundredfold."""
    material = Material(1e5, 0.2, 1000.0, damping, damping_ratio=0.0)
    limit = stable_step(MESHES[name], material, VIRIAL).limit
    assert amplitudes(MESHES[name], material, 0.9 * limit, 1000) < 10
    assert amplitudes(MESHES[name], material, 1.15 * limit, 400) > 100


def test_a_world_warns_of_a_substep_above_the_limit_and_keeps_to_it_by_itself():
    mesh = MESHES["sphere"]
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(mesh, SOFT)
    world.build()
    limit = stable_step(mesh, SOFT, VIRIAL).limit
    with pytest.warns(UnstableStepWarning, match="may explode"):
        world.step(1.15 * limit, 1)
    body.set_motion(mesh.vertices, np.zeros_like(mesh.vertices))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world.step(0.99 * limit, 1)
        world.step(1 / 60)
    assert world.stable_substeps(1 / 60) >= (1 / 60) / limit


@pytest.mark.parametrize(
    ("material", "model", "named"),
    [(SOFT, "virial", "element_model"), (SOFT, None, "element_model"), (None, VIRIAL, "Material")],
)
def test_an_estimate_needs_a_material_and_a_model(material, model, named):
    with pytest.raises(TaichiSoftError, match=named):
        stable_step(MESHES["box"], material, model)
