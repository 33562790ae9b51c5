"""Render meshes of a body: the surface, split at sharp edges, with normals of the current shape."""

import numpy as np
import pytest

from taichi_soft import (
    Material,
    MeshError,
    OptionError,
    RenderMesh,
    SoftBodyAsset,
    SpringMaterial,
    StateError,
    TetMesh,
    box,
    cloth,
    rope,
    sphere,
)
from taichi_soft.bodies import render_mesh
from taichi_soft.world.bare import bare_world

CUBE, BALL, BLOCK = box((1, 1, 1), (1, 1, 1)), sphere(0.5, 5), box((1, 1, 1), (3, 3, 3))
_TURN = np.linspace(0.0, 2 * np.pi, 13)[:-1]
SPINDLE = TetMesh(  # twelve triangles meet at each end, four at each vertex of the shaft
    np.concatenate(
        [[[0, 0, 0.6], [0, 0, -0.6]], np.stack([np.cos(_TURN), np.sin(_TURN), 0 * _TURN], axis=1) / 3]
    ),
    [[0, 1, 2 + (i + 1) % 12, 2 + i] for i in range(12)],
    fix_orientation=True,
)
JELLY, THREAD = Material(1e5, 0.3, 1000.0), SpringMaterial(500.0, 0.2)


class Zoo:
    """A world with all kinds of bodies, restored to its initial state for each test."""

    def __init__(self):
        world = self.world = bare_world(floor=None, gravity=(0, 0, 0), retries=0)
        block = SoftBodyAsset(BLOCK, JELLY, spare_vertices=100)
        world.reserve(block, 4)
        self.cube = world.add_body(CUBE, JELLY, position=(0, 0, 1))
        self.ball = world.add_body(BALL, JELLY, position=(3, 0, 1))
        self.block = world.spawn(block, position=(6, 0, 1))
        self.spindle = world.add_body(SPINDLE, JELLY, position=(0, 3, 1))
        self.sheet = world.add_body(cloth((1, 1), (4, 4), 0.2), THREAD, position=(9, 0, 1))
        self.rope = world.add_body(rope(1.0, 4, mass=0.1), THREAD, position=(12, 0, 1))
        world.build()
        self.base = world.snapshot()

    def draw(self, mesh, alpha=1.0):
        """Positions and normals of one frame."""
        count = mesh.vertex_count
        positions, normals = (np.full((count, 3), np.nan, dtype=np.float32) for _ in range(2))
        found = self.world.read_render_mesh(mesh, alpha, positions, normals)
        assert found[0] is positions
        assert found[1] is normals
        return positions, normals


@pytest.fixture(scope="module")
def built():
    return Zoo()


@pytest.fixture
def zoo(built):
    built.world.restore(built.base)
    return built


def shaken(body, by=0.05):
    """Displace the vertices of a body slightly, at random."""
    shift = np.random.default_rng(body.index).normal(scale=by, size=(body.vertex_count, 3))
    body.set_motion(body.positions() + shift, np.zeros_like(shift))


def normals_by_hand(positions, triangles):
    """Return the sum of the cross products of each vertex's triangles (twice their areas) in float64."""
    sums = np.zeros((len(positions), 3))
    for corners in triangles:
        a, b, c = positions[corners].astype(np.float64)
        for corner in corners:
            sums[corner] += np.cross(b - a, c - a)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def enclosed(positions, triangles):
    """Return the signed volume inside a closed surface. It is positive if the surface faces outwards."""
    a, b, c = (positions.astype(np.float64)[triangles[:, i]] for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize("crease", [None, 30.0, 60.0])
@pytest.mark.parametrize("name", ["cube", "ball", "block", "spindle", "sheet"])
def test_render_vertices_lie_where_the_bodys_vertices_are(zoo, name, crease):
    body = getattr(zoo, name)
    shaken(body)
    mesh = body.render_mesh(crease=crease)
    positions, _ = zoo.draw(mesh)
    assert positions.tobytes() == body.positions()[mesh.body_vertices].tobytes()
    np.testing.assert_array_equal(mesh.body_vertices[mesh.triangles], body.surface)
    np.testing.assert_array_equal(np.unique(mesh.triangles), np.arange(mesh.vertex_count))
    np.testing.assert_array_equal(np.unique(mesh.body_vertices), np.unique(body.surface))


@pytest.mark.parametrize("crease", [None, 30.0])
@pytest.mark.parametrize("name", ["cube", "ball", "block", "spindle", "sheet"])
@pytest.mark.parametrize("fewest_shared", [0, 10**9], ids=["by all threads", "by one"])
def test_normals_are_the_means_of_the_triangles_weighted_by_area(
    zoo, name, crease, fewest_shared, monkeypatch
):
    monkeypatch.setattr(render_mesh, "MIN_PARALLEL_VERTICES", fewest_shared)
    body = getattr(zoo, name)
    shaken(body)
    mesh = body.render_mesh(crease=crease)
    positions, normals = zoo.draw(mesh)
    np.testing.assert_allclose(normals, normals_by_hand(positions, mesh.triangles), atol=1e-5)


def test_normals_round_a_vertex_are_those_of_all_its_triangles_where_nothing_is_sharp(zoo):
    """The reference is computed from the body's own surface instead of the render mesh."""
    shaken(zoo.block)
    mesh = zoo.block.render_mesh(crease=None)
    outer = np.unique(zoo.block.surface)
    with np.errstate(invalid="ignore"):
        expected = normals_by_hand(zoo.block.positions(), zoo.block.surface)[outer]
    np.testing.assert_allclose(zoo.draw(mesh)[1], expected, atol=1e-5)


def test_normals_of_a_ball_point_away_from_its_middle(zoo):
    positions, normals = zoo.draw(zoo.ball.render_mesh(crease=None))
    outwards = positions - np.array([3, 0, 1])
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", normals, outwards).min() > np.cos(np.radians(2.0))


def test_a_cube_has_six_normals_or_one_for_each_vertex(zoo):
    sharp = zoo.cube.render_mesh(crease=30.0)
    assert (sharp.vertex_count, sharp.triangles.shape) == (24, (12, 3))
    normals = zoo.draw(sharp)[1]
    assert len(np.unique(normals.round(5) + 0.0, axis=0)) == 6
    assert np.isclose(np.abs(normals).max(axis=1), 1.0).all()
    smooth = zoo.cube.render_mesh(crease=None)
    positions, normals = zoo.draw(smooth)
    assert smooth.vertex_count == 8
    assert len(np.unique(normals.round(5), axis=0)) == 8
    assert (normals * (positions - np.array([0, 0, 1])) > 0.05).all()
    # 56 of the 64 vertices of this one are outside, of which 8 are corners and 24 on edges
    assert zoo.block.render_mesh(crease=None).vertex_count == 56
    assert zoo.block.render_mesh(crease=30.0).vertex_count == 56 + 2 * 8 + 24


def test_triangles_face_outwards(zoo):
    for body in (zoo.cube, zoo.ball, zoo.block, zoo.spindle):
        shaken(body, by=0.02)
        mesh = body.render_mesh()
        assert enclosed(zoo.draw(mesh)[0], mesh.triangles) == pytest.approx(body.volume(), rel=1e-4)


def test_normals_have_length_one_wherever_the_body_is_and_however_large(zoo):
    mesh = zoo.ball.render_mesh()
    rng = np.random.default_rng(0)
    for size, place in ((1e-3, 0.0), (1.0, 1e3), (1e5, 0.0), (1.0, 9e6)):
        x = size * BALL.vertices * rng.uniform(0.5, 1.5, 3) + place
        zoo.ball.set_motion(x, np.zeros_like(x))
        _, normals = zoo.draw(mesh)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)


def test_what_is_crushed_to_a_point_has_normals_upwards_and_a_flat_body_some(zoo):
    mesh = zoo.ball.render_mesh()
    still = np.zeros_like(BALL.vertices)
    zoo.ball.set_motion(still + 1.0, still)
    assert (zoo.draw(mesh)[1] == np.float32([0, 0, 1])).all()
    zoo.ball.set_motion(BALL.vertices * [1, 1, 0], still)
    assert np.linalg.norm(zoo.draw(mesh)[1], axis=1) == pytest.approx(1.0, abs=1e-5)
    x = BALL.vertices.copy()
    x[BALL.surface[0]] = x[BALL.surface[0, 0]]  # one triangle without area
    zoo.ball.set_motion(x, still)
    positions, normals = zoo.draw(mesh)
    np.testing.assert_allclose(normals, normals_by_hand(positions, mesh.triangles), atol=1e-5)


def test_a_sheet_has_two_sides_with_opposite_normals(zoo):
    mesh = zoo.sheet.render_mesh()
    _, normals = zoo.draw(mesh)
    assert mesh.vertex_count == 2 * zoo.sheet.vertex_count
    for vertex in range(zoo.sheet.vertex_count):
        one, other = normals[mesh.body_vertices == vertex]
        np.testing.assert_allclose(one, -other, atol=1e-6)
        np.testing.assert_allclose(np.abs(one), [0, 0, 1], atol=1e-6)


def test_a_rope_has_no_surface_to_draw(zoo):
    with pytest.raises(MeshError, match=r"triangles.*surface=.*ParticleMesh"):
        zoo.rope.render_mesh()


def test_a_mesh_may_be_made_before_build_and_is_read_after():
    world = bare_world(floor=None)
    mesh = world.add_body(CUBE, JELLY).render_mesh(crease=30.0)
    assert mesh.vertex_count == 24
    with pytest.raises(StateError, match="not built"):
        world.read_render_mesh(mesh, 1.0)


def test_what_a_mesh_holds_is_locked_and_comes_back_the_same(zoo):
    mesh = zoo.block.render_mesh()
    assert isinstance(mesh, RenderMesh)
    assert mesh.body is zoo.block
    assert mesh.triangles.dtype == mesh.body_vertices.dtype == np.int32
    assert not mesh.triangles.flags.writeable
    assert not mesh.body_vertices.flags.writeable
    np.testing.assert_array_equal(mesh.triangles, zoo.block.render_mesh().triangles)
    assert repr(mesh) == f"RenderMesh({mesh.vertex_count} vertices, 108 triangles)"


def test_after_a_cut_a_mesh_is_outdated_and_a_new_one_has_the_cut_faces(zoo):
    world, body = zoo.world, zoo.block
    mesh, volume = body.render_mesh(crease=None), body.volume()
    assert not mesh.is_outdated
    (fallen,) = body.cut(plane=(body.center_of_mass(), (1.0, 0.2, 0.1)))
    assert mesh.is_outdated
    assert mesh.topology_version == body.topology_version - 1
    assert "outdated" in repr(mesh)
    buffers = [np.full((mesh.vertex_count, 3), np.nan, dtype=np.float32) for _ in range(2)]
    with pytest.raises(StateError, match=r"topology_version 0.*1.*body\.render_mesh"):
        world.read_render_mesh(mesh, 1.0, *buffers)
    assert np.isnan(buffers).all()
    total = 0.0
    for part in (body, fallen):
        anew = part.render_mesh(crease=None)
        positions, normals = zoo.draw(anew)
        assert positions.tobytes() == part.positions()[anew.body_vertices].tobytes()
        np.testing.assert_allclose(normals, normals_by_hand(positions, anew.triangles), atol=1e-5)
        assert enclosed(positions, anew.triangles) == pytest.approx(part.volume(), rel=1e-4)
        total += enclosed(positions, anew.triangles)
    assert total == pytest.approx(volume, rel=1e-3)
    world.restore(zoo.base)
    again = body.render_mesh(crease=None)
    assert zoo.draw(again)[0].tobytes() == body.positions()[again.body_vertices].tobytes()
    np.testing.assert_array_equal(again.triangles, mesh.triangles)


def test_a_body_that_was_removed_is_not_drawn(zoo):
    mesh = zoo.ball.render_mesh()
    zoo.world.despawn(zoo.ball)
    with pytest.raises(StateError, match="removed by despawn"):
        zoo.world.read_render_mesh(mesh, 1.0)
    with pytest.raises(StateError, match="removed by despawn"):
        zoo.ball.render_mesh()
    zoo.world.restore(zoo.base)
    assert zoo.draw(mesh)[0].tobytes() == zoo.ball.positions()[mesh.body_vertices].tobytes()


BAD_CREASES = (-1, 181.0, float("nan"), float("inf"), "sharp", True, [30.0])


@pytest.mark.parametrize("crease", BAD_CREASES, ids=str)
def test_a_crease_that_is_no_angle_is_refused(zoo, crease):
    with pytest.raises(OptionError, match=r"crease.*0 to 180.*None"):
        zoo.ball.render_mesh(crease=crease)


def read_only(rows):
    rows.flags.writeable = False
    return rows


BAD_BUFFERS = {
    "shape": (
        lambda k: np.zeros((k - 1, 3), np.float32),
        r"must be float32 of shape \(24, 3\), got float32 of",
    ),
    "flat": (lambda k: np.zeros(3 * k, np.float32), r"got float32 of shape \(72,\)"),
    "double": (lambda k: np.zeros((k, 3)), r"must be float32 of shape \(24, 3\), got float64"),
    "columns": (lambda k: np.zeros((3, k), np.float32).T, "must be C-contiguous and writeable: make it with"),
    "interleaved": (lambda k: np.zeros((k, 6), np.float32)[:, :3], "must be C-contiguous and writeable"),
    "read-only": (lambda k: read_only(np.zeros((k, 3), np.float32)), "must be C-contiguous and writeable"),
    "list": (lambda k: [[0.0] * 3] * k, "must be a numpy array, got list"),
}


@pytest.mark.parametrize("label", BAD_BUFFERS)
@pytest.mark.parametrize("which", ["positions", "normals"])
def test_a_buffer_that_does_not_fit_is_refused_and_the_other_one_stays(zoo, which, label):
    make, message = BAD_BUFFERS[label]
    mesh = zoo.cube.render_mesh(crease=30.0)
    buffers = {name: np.full((24, 3), np.nan, dtype=np.float32) for name in ("positions", "normals")}
    bad = buffers[which] = make(24)
    before = np.array(bad)
    with pytest.raises(OptionError, match=f"{which} .*{message}|{which} {message}"):
        zoo.world.read_render_mesh(mesh, 1.0, **buffers)
    np.testing.assert_array_equal(bad, before)
    other = "normals" if which == "positions" else "positions"
    assert np.isnan(buffers[other]).all()


def test_buffers_that_share_memory_are_refused_and_neighbours_in_one_array_are_not(zoo):
    mesh = zoo.cube.render_mesh(crease=30.0)
    rows = np.zeros((48, 3), dtype=np.float32)
    for one, other in ((rows[:24], rows[:24]), (rows[:24], rows[20:44])):
        with pytest.raises(OptionError, match=r"positions.*normals.*memory"):
            zoo.world.read_render_mesh(mesh, 1.0, one, other)
    assert not rows.any()
    zoo.world.read_render_mesh(mesh, 1.0, rows[:24], rows[24:])
    assert rows.tobytes() == b"".join(each.tobytes() for each in zoo.draw(mesh))


def test_without_buffers_there_are_new_ones(zoo):
    mesh = zoo.cube.render_mesh()
    made, filled = zoo.world.read_render_mesh(mesh, 1.0), zoo.draw(mesh)
    assert [rows.dtype for rows in made] == [np.float32] * 2
    assert [rows.tobytes() for rows in made] == [rows.tobytes() for rows in filled]


def test_what_is_no_mesh_of_this_world_and_no_alpha_is_refused(zoo):
    world, mesh = zoo.world, zoo.cube.render_mesh()
    for bad in (None, "cube", CUBE):
        with pytest.raises(OptionError, match=r"mesh.*RenderMesh"):
            world.read_render_mesh(bad, 1.0)
    stranger = bare_world(floor=None).add_body(CUBE, JELLY)
    with pytest.raises(OptionError, match=r"mesh.*this world"):
        world.read_render_mesh(stranger.render_mesh(), 1.0)
    for alpha in (-0.1, 1.1, float("nan"), None, "now"):
        with pytest.raises(OptionError, match=r"alpha.*0 to 1"):
            world.read_render_mesh(mesh, alpha)
