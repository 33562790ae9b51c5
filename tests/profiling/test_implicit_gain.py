"""The comparison of implicit steps with scipy compares the same system. No time is asserted."""

import numpy as np
import pytest

from taichi_soft import Material, box, force_gradient, internal_forces
from taichi_soft.profiling.implicit import measure_implicit
from taichi_soft.profiling.profile_tables import tables
from taichi_soft.profiling.sparse import SparseBody
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

MESH = box((1.0, 0.8, 0.6), (2, 2, 2))
MATERIAL = Material(1e5, 0.3, 1000.0, 3.0, damping_ratio=0.0)


def shaken(seed, amount):
    return MESH.vertices + amount * np.random.default_rng(seed).normal(size=MESH.vertices.shape)


def test_scipys_projected_matrix_is_that_of_the_kernels_in_every_pose():
    """Two derivations of one matrix: numpy's singular values here, blocks of particles and edges there."""
    for seed, amount in ((0, 0.02), (1, 0.1), (2, 0.5)):  # the last with tetrahedra inside out
        body = SparseBody(MESH, MATERIAL)
        body.positions[:] = x = shaken(seed, amount)
        size = x.size
        total = np.zeros((size, size))
        index = (3 * MESH.tets[:, :, None] + np.arange(3)).reshape(-1, 12)
        for rows, block in zip(index, body.element_stiffness(), strict=True):
            total[np.ix_(rows, rows)] += block
        kernels = -force_gradient(MESH, MATERIAL, x, projected=True).reshape(size, size)
        np.testing.assert_allclose(total, kernels, atol=1e-6 * np.abs(kernels).max())
        np.testing.assert_allclose(body._forces(), internal_forces(MESH, MATERIAL, x), atol=1e-6)


def test_scipys_steps_move_a_body_as_the_world_does():
    native = SparseBody(MESH, MATERIAL)
    world = bare_world(floor=None, integrator="implicit_euler", tolerance=1e-6)
    body = world.add_body(MESH, MATERIAL, law="virial")
    world.build()
    x = shaken(3, 0.03)
    body.set_motion(x, np.zeros_like(x))
    native.positions[:] = x
    for _ in range(10):
        world.step(1 / 60)
        native.step(1 / 60, 1e-8)
    np.testing.assert_allclose(body.positions(), native.positions, atol=1e-4)


def test_the_gain_is_measured_for_all_three_and_shown():
    found = measure_implicit(3)
    assert [row.is_sound for row in found] == [True, True, True]
    assert found[0].step / found[0].other_step > 90  # the thesis's hundredfold step
    assert found[0].deviation is None
    assert found[1].step / found[1].other_step > 50
    assert found[2].deviation < 1e-3
    ((title, table),) = tables({"implicit": found})
    assert "Implicit" in title
    assert table.row_count == 3
