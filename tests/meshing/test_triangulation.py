"""Triangulated polygons: the sum of areas shows that triangles cover the polygon exactly once."""

import numpy as np
import pytest

from taichi_soft.meshing.triangulation import triangulated

pytestmark = pytest.mark.numpy


def star(rng, corners):
    """Make a polygon around a centre, with random distances from it."""
    angles = (np.arange(corners) + 0.8 * rng.random(corners)) / corners * 2 * np.pi
    return rng.uniform(0.1, 1.0, corners)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def spiral(turns=3, steps=40):
    angles = np.linspace(0, 2 * np.pi * turns, steps)
    arm = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([arm * (1 + angles)[:, None], (arm * (3 + angles)[:, None])[::-1]])


SHAPES = {
    "L": [(0, 0), (4, 0), (4, 2), (3, 2), (3, 4), (0, 4)],
    "arrow": [(0, 0), (2, 1), (0, 2), (1, 1)],
    "arrow, from its notch": [(1, 1), (0, 0), (2, 1), (0, 2)],
    "corners in a line": [(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (1, 1), (0, 1)],
    "comb": [(0, 0), (9, 0), *((9 - i, 5 if i % 2 else 1) for i in range(10))],
    "a hole, joined by a cut": [
        (0, 0),
        (4, 0),
        (4, 4),
        (0, 4),
        (0, 0),
        (1, 1),
        (1, 3),
        (3, 3),
        (3, 1),
        (1, 1),
    ],
    "spiral": spiral(),
    **{f"star {k}": star(np.random.default_rng(k), k) for k in (5, 9, 20, 60)},
}


def shoelace(points):
    x, y = np.asarray(points, dtype=float).T
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("name", SHAPES)
def test_triangles_cover_a_polygon_once_and_face_as_it_does(name):
    flat = np.asarray(SHAPES[name], dtype=float)
    for seed, sense in ((0, 1), (1, -1), (2, 1)):
        rng = np.random.default_rng(seed)
        plane, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        points = np.roll(flat, seed * 2, axis=0)[::sense] @ plane[:2] + rng.normal(size=3)
        triangles, polygon = triangulated(points, np.array([len(points)]))
        assert len(triangles) == len(points) - 2
        assert (polygon == 0).all()
        a, b, c = np.moveaxis(points[triangles], 1, 0)
        along = np.cross(b - a, c - a) @ np.cross(plane[0], plane[1]) / 2
        assert (along * np.sign(shoelace(flat)) * sense > -1e-9).all()
        assert np.abs(along).sum() == pytest.approx(abs(shoelace(flat)), rel=1e-9)


def test_polygons_come_out_in_their_order_whatever_is_between():
    """Some polygons have no area, cross themselves, or have only two corners."""
    kinds = [SHAPES["arrow"], [(0, 0), (1, 0), (0, 1)], [(0, 0), (1, 1)], SHAPES["L"], [(0, 0)] * 5]
    kinds += [[(0, 0), (1, 1), (1, 0), (0, 1)], [(0, 0), (1, 0), (1, 1), (0, 1)]]
    corners = np.concatenate(
        [np.c_[np.asarray(each, float), np.full(len(each), z)] for z, each in enumerate(kinds)]
    )
    triangles, polygon = triangulated(corners, np.array([len(each) for each in kinds]))
    assert polygon.tolist() == sorted(polygon)
    np.testing.assert_array_equal(corners[triangles][:, :, 2], np.repeat(polygon[:, None], 3, axis=1))
    np.testing.assert_array_equal(np.bincount(polygon, minlength=len(kinds)), [2, 1, 0, 4, 3, 2, 2])
