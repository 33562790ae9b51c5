"""Images under the bounds check, with triangles that no camera should show."""

import numpy as np
import pytest

from taichi_soft import sphere
from taichi_soft.render import Camera, Renderer, Surface

pytestmark = pytest.mark.soak

BALL = sphere(0.05, 3)
CAMERAS = {
    "usual": Camera((0.0, -2.0, 1.0)),
    "close": Camera((0.0, -0.2, 0.1), (0.0, 0.0, 0.05), fov_degrees=150.0),
    "under a lens": Camera((1e-6, 0.0, 2e-6), fov_degrees=1.0),
    "from afar": Camera((6e5, 6e5, 1e5), fov_degrees=1.0),
}


def odd_triangles(rng):
    """Return triangles behind the eye, through it, far outside the image, very large, or without area."""
    count = 30
    places = rng.normal(size=(count, 1, 3)) * 10.0 ** rng.uniform(-7, 6.9, (count, 1, 1))
    corners = places + rng.normal(size=(count, 3, 3)) * 10.0 ** rng.uniform(-7, 6.9, (count, 1, 1))
    kind = np.arange(count) % 6
    corners[kind == 0, 1] = corners[kind == 0, 0]
    corners[kind == 1, 2] = 0.5 * (corners[kind == 1, 0] + corners[kind == 1, 1])
    corners[kind == 2, :] = corners[kind == 2, :1]
    corners[kind == 3, :, rng.integers(3)] = 0.0
    return np.clip(corners.reshape(-1, 3), -9.9e6, 9.9e6), np.arange(3 * count).reshape(-1, 3)


@pytest.mark.parametrize("name", CAMERAS)
def test_odd_triangles_stay_within_the_picture(name):
    renderer = Renderer(70, 50, camera=CAMERAS[name], floor=0.0)
    rng = np.random.default_rng(3)
    lying = BALL.vertices + np.array([0.0, 0.0, 0.05])
    for _ in range(60):
        beside = Surface(lying, BALL.surface)
        picture = renderer.render([beside, Surface(*odd_triangles(rng))])
        assert picture.shape == (50, 70, 3)
