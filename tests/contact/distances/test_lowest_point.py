"""The point of a triangle that is deepest in a collider, against dense samples of the triangle in float64."""

import numpy as np
import pytest

from taichi_soft import BoxShape, CapsuleShape, Material, SphereShape, box
from taichi_soft.contact.distances.lowest_point import lowest_point
from taichi_soft.core.runtime import ti
from taichi_soft.solver.state import State
from taichi_soft.world.bare import bare_world

COUNT = 300
SHAPES = {
    "box": BoxShape((0.4, 0.3, 0.02)),
    "capsule": CapsuleShape(radius=0.02, length=0.5),
    "sphere": SphereShape(0.1),
}


@ti.kernel
def _find(
    colliders: ti.template(),
    corners: ti.types.ndarray(dtype=ti.f32, ndim=3),
    out: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    for i in range(corners.shape[0]):
        x = ti.Vector([corners[i, 0, k] for k in ti.static(range(3))])
        y = ti.Vector([corners[i, 1, k] for k in ti.static(range(3))])
        z = ti.Vector([corners[i, 2, k] for k in ti.static(range(3))])
        found = lowest_point(colliders, 0, x, y, z, colliders.surface[0].z)
        for k in ti.static(range(7)):
            out[i, k] = found[k]


def distance(name, x):
    """Signed distance of points from a shape, (n,) [m]."""
    if name == "sphere":
        return np.linalg.norm(x, axis=-1) - 0.1
    if name == "capsule":
        beside = x.copy()
        beside[..., 2] -= np.clip(x[..., 2], -0.25, 0.25)
        return np.linalg.norm(beside, axis=-1) - 0.02
    over = np.abs(x) - [0.2, 0.15, 0.01]
    return np.linalg.norm(np.maximum(over, 0.0), axis=-1) + np.minimum(over.max(axis=-1), 0.0)


def weights_of(count):
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij"))
    return np.stack([i, j, count - i - j], axis=1)[i + j <= count] / count


@pytest.mark.parametrize("name", SHAPES)
def test_no_point_of_a_triangle_is_lower_than_the_one_found(name):
    world = bare_world(floor=None)
    world.add_collider(SHAPES[name], thickness=0.0)
    world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.3, 1000.0), position=(5, 0, 0))
    world.build()
    state = world._built.state
    assert isinstance(state, State)
    rng = np.random.default_rng(3)
    corners = rng.uniform(-0.4, 0.4, (COUNT, 3, 3)).astype(np.float32)
    corners[: COUNT // 3, 2] = corners[: COUNT // 3, 1]  # lines
    skin = state.colliders.surface.to_numpy()[0, 2]
    out = np.zeros((COUNT, 7), dtype=np.float32)
    _find(state.colliders, corners, out)
    out[:, 3] += skin
    x = corners.astype(np.float64)
    points = np.einsum("wk,nka->nwa", weights_of(120), x)
    lowest = distance(name, points).min(axis=1)
    own = np.einsum("nk,nka->na", out[:, :3].astype(np.float64), x)
    assert distance(name, own) == pytest.approx(out[:, 3], abs=1e-6)
    assert (out[:, 3] - lowest).max() < 5e-5
    assert (lowest - out[:, 3]).max() < 8e-3  # the samples are up to 7 mm apart
    # The gradient bounds the distance of the whole triangle from below.
    heights = np.einsum("na,nwa->nw", out[:, 4:7], points - own[:, None])
    assert (distance(name, points) >= out[:, 3, None] + heights - 5e-5).all()
