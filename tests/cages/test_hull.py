"""Hulls of surfaces: their points and triangles, and their attachment to a cage."""

import numpy as np
import pytest
import surfaces
import trimesh
from difficult_surfaces import letter

from taichi_soft.bodies.bound_hull import MIN_WEIGHT, bind
from taichi_soft.cages import tetrahedra_of
from taichi_soft.cages.hull import hull_of
from taichi_soft.meshing.surfaces import read_surfaces

pytestmark = pytest.mark.numpy

BALL = surfaces.ball()
DIRECTIONS = np.random.default_rng(0).normal(size=(400, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


def volume_within(hull):
    a, b, c = np.moveaxis(hull.points[hull.triangles], 1, 0)
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    "surface", [BALL, letter(), trimesh.creation.torus(0.5, 0.2)], ids=["ball", "letter", "ring"]
)
def test_points_lie_on_the_surface_and_reach_as_far_as_it(surface):
    """The extent in every direction agrees to 2 % of the size.

    The number of points is at most the requested one.
    """
    hull = hull_of(read_surfaces(surface), 300)
    assert 200 < len(hull.points) <= 300
    size = np.ptp(surface.vertices, axis=0).max()
    lacking = (surface.vertices @ DIRECTIONS.T).max(axis=0) - (hull.points @ DIRECTIONS.T).max(axis=0)
    assert lacking.min() > -1e-9
    assert lacking.max() < 0.02 * size


def test_the_sides_of_a_sheet_stay_apart():
    hull = hull_of(read_surfaces(trimesh.creation.box((1, 1, 0.01))), 200)
    inner = hull.points[np.abs(hull.points[:, :2]).max(axis=1) < 0.49]
    assert np.abs(inner[:, 2]) == pytest.approx(np.full(len(inner), 0.005))
    assert 40 < (inner[:, 2] > 0).sum() < len(inner) - 40
    assert volume_within(hull) == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("share", [0.0, 0.2, 1.0])
def test_triangles_face_outward_whichever_way_those_of_the_surface_face(share):
    hull = hull_of(read_surfaces(surfaces.with_some_turned(BALL, share)), 300)
    a, b, c = np.moveaxis(hull.points[hull.triangles], 1, 0)
    outward = np.einsum("ti,ti->t", np.cross(b - a, c - a), a + b + c) > 0.0
    assert outward.mean() > (0.95 if share in (0.0, 1.0) else 0.9)


@pytest.mark.parametrize("count", [300, 500, 1000])
def test_triangles_close_the_surface_without_folds(count):
    """Each edge of a ball's hull has two triangles, all facing outwards. Euler's formula holds."""
    hull = hull_of(read_surfaces(BALL), count)
    corners = hull.triangles.astype(int)
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    there, back = ({tuple(edge) for edge in each} for each in (edges, edges[:, ::-1]))
    assert len(there) == len(edges)
    assert there == back
    assert len(corners) == 2 * len(np.unique(corners)) - 4
    a, b, c = np.moveaxis(hull.points[corners], 1, 0)
    assert np.einsum("ti,ti->t", np.cross(b - a, c - a), a + b + c).min() > -1e-5


def test_walls_within_belong_to_no_hull():
    within = surfaces.joined(BALL, trimesh.creation.box((0.5, 0.5, 0.5)))
    assert np.linalg.norm(hull_of(read_surfaces(within), 300).points, axis=1).min() > 0.95


def test_points_are_carried_by_weights_of_a_tetrahedron():
    """The points stay in place, inside and outside the cage.

    Points that are too far outside move towards the nearest point of the cage.
    """
    rod = trimesh.creation.cylinder(0.02, 1.0, sections=8).apply_translation((0, 0, 1.2))
    parts = read_surfaces(surfaces.joined(BALL, rod))
    mesh = tetrahedra_of(read_surfaces(BALL), cells=6).mesh
    hull = hull_of(parts, 400)
    carried = bind(mesh, hull)
    assert carried.weights.sum(axis=1) == pytest.approx(np.ones(len(hull.points)))
    assert carried.weights.min() >= MIN_WEIGHT - 1e-9
    assert np.einsum("hc,hcx->hx", carried.weights, mesh.vertices[carried.vertices]) == pytest.approx(
        carried.points
    )
    is_near = np.linalg.norm(hull.points, axis=1) < 1.05
    assert carried.points[is_near] == pytest.approx(hull.points[is_near], abs=1e-9)
    tip = carried.points[:, 2].max()
    assert 1.05 < tip < 1.6
