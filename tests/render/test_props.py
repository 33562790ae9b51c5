"""What is drawn beside the bodies: where colliders and props are, and which are drawn at all."""

import numpy as np
import pytest
import trimesh

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    BoxShape,
    CapsuleShape,
    HeightFieldShape,
    Material,
    OptionError,
    PlaneShape,
    SphereShape,
    box,
)
from taichi_soft.render import Camera, Renderer
from taichi_soft.render.film import Actor, Stage, film
from taichi_soft.render.props import Prop, Scenery
from taichi_soft.world.bare import bare_world


def about_y(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.fixture(scope="module")
def world():
    """A box far above a collider, a frame and the floor."""
    world = bare_world(soft_contact=False)
    world.add_collider(BoxShape((1, 2, 3)), position=(0, 0, 2))
    world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.2, 1000, 10), position=(0, 0, 50))
    world.build()
    return world


@pytest.mark.soak
def test_a_collider_is_drawn_on_its_way_between_the_last_two_steps(world):
    collider = world.colliders[0]
    scenery = Scenery(world)
    start = collider.position
    collider.move_to(start + np.array([1, 0, 0]), about_y(0.4))
    scenery.remember()
    world.step(1 / 50, 1)
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-1, 1) for z in (-1.5, 1.5)])
    for alpha in (0.0, 0.5, 1.0):
        (surface,) = scenery.at(alpha)
        expected = corners @ about_y(0.4 * alpha).T + start + (alpha, 0, 0)
        drawn = np.unique(surface.positions.round(4), axis=0)
        np.testing.assert_allclose(drawn, np.unique(expected.round(4), axis=0), atol=2e-4)
    collider.teleport(start, np.eye(3))


def test_a_prop_goes_with_its_frame(world):
    frame = world.add_frame((1, 2, 3), about_y(0.3))
    surface = Scenery(world, [Prop(SphereShape(0.5).surface(), frame)]).at(1.0)[1]
    np.testing.assert_allclose(np.linalg.norm(surface.positions - (1, 2, 3), axis=1), 0.5, atol=1e-5)


def test_the_floor_is_left_to_the_renderer_and_a_slope_is_not():
    world = bare_world()
    world.add_collider(PlaneShape((0, 0, 2.0)))
    assert not Scenery(world).at(1.0)
    world.add_collider(PlaneShape((0, 1, 2)))
    assert len(Scenery(world).at(1.0)) == 1


def test_ground_is_drawn_with_sides_that_face_outwards():
    world = bare_world()
    heights = 1.0 + np.random.default_rng(3).random((4, 6))
    heights[1, 2] = 0.5
    world.add_collider(HeightFieldShape(heights, spacing=0.5))
    (surface,) = Scenery(world).at(1.0)
    drawn = trimesh.Trimesh(surface.positions, surface.triangles)
    drawn.merge_vertices(merge_norm=True)
    alone = trimesh.grouping.group_rows(drawn.edges_sorted, require_count=1)
    open_edges = drawn.edges_sorted[alone]
    assert len(open_edges) == 2 * (3 + 5)  # at the bottom only
    np.testing.assert_allclose(drawn.vertices[open_edges.ravel(), 2], drawn.bounds[0, 2])
    sides = np.abs(drawn.face_normals[:, 2]) < 1e-6
    outwards = (drawn.triangles_center * drawn.face_normals)[sides].sum(axis=1)
    assert sides.sum() == 2 * 2 * (3 + 5)
    np.testing.assert_allclose(
        outwards, np.where(drawn.face_normals[sides][:, 0] != 0, 0.75, 1.25), atol=1e-5
    )


def test_all_shapes_face_outwards_in_the_picture():
    for shape in (BoxShape((1, 2, 3)), CapsuleShape(0.3, 1.0), SphereShape(0.4)):
        assert trimesh.Trimesh(*shape.surface()).volume > 0


def test_a_script_acts_before_every_step_of_a_film_and_colliders_are_in_the_picture(monkeypatch, tmp_path):
    world = bare_world()
    lift = world.add_collider(BoxShape((1, 1, 0.2)), position=(0, 0, 1.0))
    body = world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.2, 1000, 10), position=(0, 0, 4))
    world.build()
    calls, heights = [], []

    def act(acted):
        calls.append((acted, acted.step_count))
        lift.move_to((0, 0, 1.0 + 0.01 * (acted.step_count + 1)))

    original = Renderer.render

    def watched(self, surfaces):
        heights.append(surfaces[0].positions[:, 2].max())
        assert len(surfaces) == 2
        return original(self, surfaces)

    monkeypatch.setattr(Renderer, "render", watched)
    camera = Camera.framing((-1, -1, 0), (1, 1, 5))
    stage = Stage("lift", world, [Actor(body)], camera, FixedStep(dt=0.02), 0.12, act=act)
    film(stage, tmp_path / "lift.png", size=(64, 48))
    assert calls == [(world, k) for k in range(5)]
    # Once before the film begins; then, as bodies, one step behind.
    np.testing.assert_allclose(heights, [1.1, 1.1, 1.1, 1.11, 1.12, 1.13, 1.14], atol=1e-5)


def test_what_acts_before_a_step_must_be_callable(world):
    with pytest.raises(OptionError, match="before_step"):
        EngineAdapter(world, before_step=3)


def test_a_step_before_which_something_goes_wrong_is_not_made(world):
    def fail(_):
        raise RuntimeError("not today")

    game = EngineAdapter(world, FixedStep(dt=0.02), before_step=fail)
    before = world.step_count
    with pytest.raises(RuntimeError, match="not today"):
        game.advance(0.04)
    assert world.step_count == before
    assert game.dropped_time == pytest.approx(0.04)
