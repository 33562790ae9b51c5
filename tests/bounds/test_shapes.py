"""Grids of random and degenerate shapes under the bounds check, evaluated at any position."""

import sys
from pathlib import Path

import numpy as np
import pytest

from taichi_soft import HeightFieldShape, MeshError, MeshShape, init
from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.core.runtime import ti

sys.path.insert(0, str(Path(__file__).parents[1] / "contact" / "distances"))

from test_mesh import MESHES, random_blocks, random_tetrahedra, sliver_at_a_junction

pytestmark = pytest.mark.soak

vec8, ivec3 = ti.types.vector(8, ti.f32), ti.types.vector(3, ti.i32)
PLACES = np.array([0.0, 1e-30, 0.3, 1.0, 40.0, 9.9e6, 3e9, 1e30, np.inf])
"""Coordinates [m] that particles have, and such as they have within a step before they are put back."""


@ti.kernel
def measure(
    samples: ti.template(),
    kind: ti.i32,
    parameters: vec8,
    resolution: ivec3,
    points: ti.types.ndarray(dtype=ti.f32, ndim=2),
    out: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    for i in range(points.shape[0]):
        x = ti.Vector([points[i, 0], points[i, 1], points[i, 2]])
        out[i] = signed_distance(samples, kind, parameters, resolution, 0, x)[0]


def ask(shape):
    """Evaluate a shape at random positions inside and around it, at its nodes, and at extreme positions."""
    rng = np.random.default_rng(4)
    low, high = (np.nan_to_num(corner, neginf=-1.0, posinf=1.0) for corner in shape.bounds)
    inside = rng.uniform(low - 0.2, high + 0.2, (400, 3))
    odd = rng.choice([*PLACES, *-PLACES, np.nan], size=(600, 3))
    points = np.concatenate([inside, odd, shape.surface()[0][:200]]).astype(np.float32)
    samples = ti.field(ti.f32, len(shape.samples))  # without a row to spare
    samples.from_numpy(shape.samples)
    out = np.empty(len(points), dtype=np.float32)
    measure(samples, int(shape.kind), vec8(*shape.parameters), ivec3(*shape.resolution), points, out)
    assert np.isfinite(out[:400]).all()


@pytest.mark.parametrize("name", MESHES)
def test_the_grid_of_a_mesh(name):
    init()
    ask(MeshShape(MESHES[name], cache=False))


@pytest.mark.parametrize(
    ("make", "fit"), [(sliver_at_a_junction, 40), (random_tetrahedra, 6), (random_blocks, 40)]
)
def test_grids_of_surfaces_with_slivers(make, fit):
    """Sizes vary by a factor of thousands, and vertices lie on nodes. Too thin surfaces may be refused."""
    init()
    taken = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        vertices, triangles = make(rng)[2]
        for scale, decimals in ((1.0, 9), (3e4, 9), (1e-4, 9), (1.0, 1)):
            rounded = np.round(vertices, decimals)
            try:
                shape = MeshShape((rounded * scale, triangles), cell=scale / 60, cache=False)
            except MeshError:
                continue
            taken += 1
            if taken < 3:
                ask(shape)
    assert taken >= fit


@pytest.mark.parametrize("size", [(2, 2), (2, 9), (31, 7)])
def test_height_fields(size):
    """The height fields are flat, random or have cliffs."""
    init()
    rng = np.random.default_rng(5)
    for heights in (np.zeros(size), rng.normal(size=size), 1e5 * rng.integers(-1, 2, size)):
        ask(HeightFieldShape(heights, 0.25))
