"""Descriptions of shapes: their data for kernels and images, and the arguments that they refuse."""

import dataclasses

import numpy as np
import pytest
import trimesh

from taichi_soft import BoxShape, CapsuleShape, HeightFieldShape, OptionError, PlaneShape, SphereShape
from taichi_soft.render import Surface

pytestmark = pytest.mark.kernel

ROUND = {
    "sphere": (SphereShape(0.7), 4 / 3 * np.pi * 0.7**3),
    "box": (BoxShape((0.5, 1.0, 2.0)), 1.0),
    "capsule": (CapsuleShape(0.3, 1.2), np.pi * 0.3**2 * 1.2 + 4 / 3 * np.pi * 0.3**3),
    "capsule without length": (CapsuleShape(0.3, 0), 4 / 3 * np.pi * 0.3**3),
}


@pytest.mark.parametrize("name", ROUND)
def test_a_surface_is_closed_faces_outwards_and_fills_the_bounds(name):
    shape, volume = ROUND[name]
    vertices, triangles = shape.surface()
    mesh = trimesh.Trimesh(vertices, triangles)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(volume, rel=0.02)
    np.testing.assert_allclose(mesh.bounds, shape.bounds, atol=1e-12)
    assert Surface(vertices, triangles).vertex_count == len(vertices)


def test_a_plane_is_drawn_as_a_square_seen_from_above():
    vertices, triangles = PlaneShape((1, 2, -2)).surface(3.0)
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    areas = np.cross(b - a, c - a) / 2
    np.testing.assert_allclose(areas.sum(axis=0), 9.0 * np.array([1, 2, -2]) / 3, atol=1e-12)
    np.testing.assert_allclose(vertices @ [1, 2, -2], 0, atol=1e-12)


def test_a_height_field_is_drawn_as_it_is_seen_from_above():
    heights = np.arange(12.0).reshape(4, 3) ** 1.5 / 10
    shape = HeightFieldShape(heights, 0.5)
    vertices, triangles = shape.surface()
    assert len(triangles) == 2 * 3 * 2
    np.testing.assert_allclose(vertices[1 * 3 + 2], [-0.25, 0.5, heights[1, 2]], atol=1e-6)
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    np.testing.assert_allclose(areas, 0.125)
    np.testing.assert_allclose(shape.bounds, [[-0.75, -0.5, -np.inf], [0.75, 0.5, heights.max()]])
    assert shape.resolution == (4, 3, 1)
    np.testing.assert_array_equal(shape.samples, heights.astype(np.float32).reshape(-1))


def test_shapes_are_immutable():
    ground = HeightFieldShape(np.eye(3), 1.0)
    for shape in (PlaneShape(), SphereShape(1), BoxShape((1, 2, 3)), CapsuleShape(1, 2), ground):
        assert shape.parameters.dtype == np.float32
        assert shape.parameters.shape == (8,)
        assert len(shape.samples) == (9 if shape is ground else 0)
        for array in (shape.parameters, shape.bounds, shape.samples):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
        for field in dataclasses.fields(shape):
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(shape, field.name, 1.0)
    size = np.ones(3)
    box = BoxShape(size)
    size[:] = 5
    assert box.bounds.tolist() == [[-0.5] * 3, [0.5] * 3]


@pytest.mark.parametrize(
    "make",
    [
        lambda: PlaneShape((0, 0, 0)),
        lambda: PlaneShape((0, 0, np.nan)),
        lambda: PlaneShape((0, 1)),
        lambda: PlaneShape().surface(0),
        lambda: SphereShape(0),
        lambda: SphereShape(-1),
        lambda: SphereShape(np.inf),
        lambda: SphereShape("1"),
        lambda: SphereShape(1e-9),
        lambda: BoxShape(1.0),
        lambda: BoxShape((1, 0, 1)),
        lambda: BoxShape((1, 1, np.inf)),
        lambda: CapsuleShape(0, 1),
        lambda: CapsuleShape(1, -0.1),
        lambda: CapsuleShape(1, None),
        lambda: HeightFieldShape([1.0, 2.0], 1.0),
        lambda: HeightFieldShape(np.zeros((1, 5)), 1.0),
        lambda: HeightFieldShape([[0.0, np.nan], [0.0, 0.0]], 1.0),
        lambda: HeightFieldShape(np.full((2, 2), 2e6), 1.0),
        lambda: HeightFieldShape(np.zeros((2, 2)), 0.0),
    ],
)
def test_what_is_no_shape_is_refused_with_what_was_given(make):
    with pytest.raises(OptionError, match=r"must|got"):
        make()
