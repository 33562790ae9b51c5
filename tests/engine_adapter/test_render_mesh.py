"""Render data of the adapter: vertices and normals between the last two steps."""

import numpy as np
import pytest
from reading import burst

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import FrozenBodyWarning, OptionError, StateError

DT = 1 / 60


@pytest.fixture
def adapter(make_world):
    return EngineAdapter(make_world(retries=0), FixedStep(dt=DT, substeps=8))


def normals_by_hand(positions, triangles):
    """Return the sum of the cross products of each vertex's triangles (twice their areas) in float64."""
    sums = np.zeros((len(positions), 3))
    for corners in triangles:
        a, b, c = positions[corners].astype(np.float64)
        for corner in corners:
            sums[corner] += np.cross(b - a, c - a)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def test_between_two_steps_the_shape_in_between_is_drawn(adapter):
    world, body = adapter.world, adapter.world.bodies[0]
    skin = body.render_mesh(crease=40.0)
    vertices, normals = (np.empty((skin.vertex_count, 3), np.float32) for _ in range(2))
    body.set_velocity((0, 0, 0), angular=(3.0, 0, 9.0))
    for part in (0.0, 0.25, 0.5, 0.2):
        before = body.positions()
        adapter.step()
        assert adapter.advance(part * DT) == 0
        now, alpha = body.positions(), adapter.alpha
        assert np.abs(now - before).max() > 0.02
        found = adapter.render_mesh(skin, vertices, normals)
        assert found[0] is vertices
        assert found[1] is normals
        expected = (1 - alpha) * before.astype(float) + alpha * now.astype(float)
        np.testing.assert_allclose(vertices, expected[skin.body_vertices], atol=2e-6)
        assert vertices.tobytes() == adapter.positions(body)[skin.body_vertices].tobytes()
        np.testing.assert_allclose(normals, normals_by_hand(vertices, skin.triangles), atol=1e-5)
    for alpha, rows in ((0.0, before), (1.0, now)):
        assert world.read_render_mesh(skin, alpha)[0].tobytes() == rows[skin.body_vertices].tobytes()


def test_a_loop_draws_without_buffers_too(adapter):
    skin = adapter.world.bodies[0].render_mesh()
    adapter.advance(2.5 * DT)
    made = adapter.render_mesh(skin)
    filled = tuple(np.empty((skin.vertex_count, 3), np.float32) for _ in range(2))
    adapter.render_mesh(skin, *filled)
    assert [rows.tobytes() for rows in made] == [rows.tobytes() for rows in filled]


def test_a_frozen_body_is_drawn_where_it_froze(adapter):
    body = adapter.world.bodies[0]
    skin = body.render_mesh()
    adapter.step()
    burst(body)
    with pytest.warns(FrozenBodyWarning):
        adapter.step()
    assert body.is_frozen
    adapter.advance(0.5 * DT)
    vertices, normals = adapter.render_mesh(skin)
    np.testing.assert_allclose(vertices, body.positions()[skin.body_vertices], atol=1e-6)
    np.testing.assert_allclose(normals, normals_by_hand(vertices, skin.triangles), atol=1e-5)


def test_buffers_and_meshes_that_do_not_fit_are_refused_untouched(adapter, make_world, unfit_buffer):
    body = adapter.world.bodies[0]
    skin = body.render_mesh()
    sound = np.full((skin.vertex_count, 3), np.nan, np.float32)
    for which in ("positions", "normals"):
        unfit = unfit_buffer(skin.vertex_count)
        copy = np.array(unfit)
        with pytest.raises(OptionError, match=f"{which} must be"):
            adapter.render_mesh(skin, **{"positions": sound, "normals": sound.copy()} | {which: unfit})
        np.testing.assert_array_equal(np.array(unfit), copy)
        assert np.isnan(sound).all()
    for stranger in (make_world().bodies[0].render_mesh(), body, None, 0):
        with pytest.raises(OptionError, match="mesh must be"):
            adapter.render_mesh(stranger, sound, sound.copy())
    adapter.world.despawn(body)
    with pytest.raises(StateError, match="removed by despawn"):
        adapter.render_mesh(skin, sound, sound.copy())
    assert np.isnan(sound).all()
