"""Signed distances of shapes at many points, by the function that the contact kernels call."""

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.core.runtime import ti

vec8 = ti.types.vector(8, ti.f32)
ivec3 = ti.types.vector(3, ti.i32)
SPARE = 11
"""Foreign samples in front of a shape's own, so that its offset counts."""


@ti.kernel
def _measure(
    samples: ti.template(),
    kind: ti.i32,
    parameters: vec8,
    resolution: ivec3,
    offset: ti.i32,
    points: ti.types.ndarray(dtype=ti.f32, ndim=2),
    out: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    for i in range(points.shape[0]):
        x = ti.Vector([points[i, 0], points[i, 1], points[i, 2]])
        distance, normal = signed_distance(samples, kind, parameters, resolution, offset, x)
        out[i, 0] = distance
        for k in ti.static(range(3)):
            out[i, 1 + k] = normal[k]


@pytest.fixture(scope="session")
def measure():
    """Return the function measure(shape, points (n, 3)) -> distances (n,), normals (n, 3), both float64."""
    init()
    samples = ti.field(ti.f32, 1 << 21)
    loaded = None

    def run(shape, points):
        nonlocal loaded
        if len(shape.samples) and shape is not loaded:
            loaded = shape
            whole = np.full(1 << 21, np.nan, dtype=np.float32)
            whole[SPARE : SPARE + len(shape.samples)] = shape.samples
            samples.from_numpy(whole)
        rows = np.ascontiguousarray(points, dtype=np.float32)
        out = np.empty((len(rows), 4), dtype=np.float32)
        parameters, resolution = vec8(*shape.parameters), ivec3(*shape.resolution)
        _measure(samples, int(shape.kind), parameters, resolution, SPARE, rows, out)
        return out[:, 0].astype(np.float64), out[:, 1:].astype(np.float64)

    return run
