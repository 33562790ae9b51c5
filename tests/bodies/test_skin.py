"""An artist's mesh on a body that rests, rotates, bends, is cut or torn."""

import numpy as np
import pytest
import trimesh
from surfaces import ball, joined

from taichi_soft import (
    Material,
    MeshError,
    OptionError,
    SkinMesh,
    SoftBodyAsset,
    SpringMaterial,
    StateError,
    Tearing,
    box,
    rope,
    sphere,
)
from taichi_soft.bodies import skin_mesh
from taichi_soft.doctor.triangle_facts import facts_of
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

JELLY = Material(1e5, 0.3, 1000.0)
BAR = trimesh.creation.box((3.0, 0.6, 0.6)).subdivide().subdivide().subdivide()
BLOB = joined(ball(0.5, 4), ball(0.35, 4, at=(0.5, 0, 0)))


class Zoo:
    """A world with all kinds of bodies, restored to its initial state for each test."""

    def __init__(self):
        world = self.world = bare_world(floor=None, gravity=(0, 0, 0), retries=0)
        self.bar = world.add_body(SoftBodyAsset.from_surface(BAR, JELLY, cells=10))
        self.blob = world.add_body(SoftBodyAsset.from_surface(BLOB, JELLY, cells=8), position=(5, 0, 0))
        carried = SoftBodyAsset(sphere(0.5, 5), JELLY, skin=(ball(0.6), ball(0.2)), spare_vertices=100)
        world.reserve(carried, 4)
        self.carrier = world.spawn(carried, position=(8, 0, 0))
        self.plain = world.add_body(box((1, 1, 1), (2, 2, 2)), JELLY, position=(11, 0, 0))
        world.build()
        self.base = world.snapshot()

    def draw(self, mesh, alpha=1.0):
        return self.world.read_render_mesh(mesh, alpha)


@pytest.fixture(scope="module")
def built():
    return Zoo()


@pytest.fixture
def zoo(built):
    built.world.restore(built.base)
    return built


def put(body, places):
    body.set_motion(places, np.zeros_like(places))


def test_at_rest_a_skin_is_where_the_artist_made_it(zoo):
    for body, mesh in ((zoo.bar, BAR), (zoo.blob, BLOB)):
        put(body, body.asset.mesh.vertices)
        (skin,) = body.render_meshes
        positions, normals = zoo.draw(skin)
        size = np.ptp(mesh.vertices, axis=0).max()
        np.testing.assert_allclose(positions, mesh.vertices, atol=1e-6 * size)
        np.testing.assert_allclose(normals, body.asset.skins[0].surface.normals, atol=1e-6)
        np.testing.assert_array_equal(skin.triangles, mesh.faces)


def test_a_rigid_motion_moves_positions_and_normals_rigidly(zoo):
    turn = trimesh.transformations.rotation_matrix(1.2, (1, -2, 0.5))[:3, :3]
    for body, mesh in ((zoo.bar, BAR), (zoo.blob, BLOB)):
        put(body, body.asset.mesh.vertices @ turn.T + [0.3, -0.2, 0.4])
        positions, normals = zoo.draw(body)
        np.testing.assert_allclose(positions, mesh.vertices @ turn.T + [0.3, -0.2, 0.4], atol=1e-6)
        np.testing.assert_allclose(normals, body.asset.skins[0].surface.normals @ turn.T, atol=1e-6)


def test_a_uniform_deformation_is_exact_inside_and_out(zoo):
    """Normals turn by the cofactor of F (Nanson's formula)."""
    F = np.array([[1.2, 0.3, 0.0], [-0.1, 0.8, 0.2], [0.0, 0.1, 1.1]])
    body = zoo.carrier  # its skin is larger than the body
    put(body, body.asset.mesh.vertices @ F.T)
    for skin, surface in zip(body.render_meshes, (ball(0.6), ball(0.2)), strict=True):
        positions, normals = zoo.draw(skin)
        np.testing.assert_allclose(positions, surface.vertices @ F.T, atol=3e-6)
        wanted = surface.vertices @ np.linalg.inv(F)
        wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
        np.testing.assert_allclose(normals, wanted, atol=0.02)


def bent(places):
    """Bend positions along an arc of 90 degrees."""
    radius = 3.0 / (np.pi / 2)
    angle, reach = places[:, 0] / radius, radius - places[:, 2]
    return np.stack([reach * np.sin(angle), places[:, 1], radius - reach * np.cos(angle)], axis=1)


def test_a_bent_bar_has_no_creases_at_the_faces_of_its_tetrahedra(zoo):
    """Linear interpolation in each tetrahedron would be more than ten times as far from the arc."""
    body = zoo.bar
    cage, (skin,) = body.asset.mesh, body.asset.skins
    put(body, bent(cage.vertices))
    positions, normals = zoo.draw(body)
    exact = bent(np.asarray(BAR.vertices))
    linear = np.einsum("kc,kcx->kx", skin.weights, bent(cage.vertices)[cage.tets[skin.tets]])
    off, off_linear = (np.linalg.norm(found - exact, axis=1) for found in (positions, linear))
    assert np.sqrt((off**2).mean()) < 0.1 * np.sqrt((off_linear**2).mean())
    assert off.max() < 0.01
    across = np.abs(BAR.vertices[:, 0]) < 1.3  # but for the ends
    up = across & (BAR.vertices[:, 2] > 0.29) & (np.abs(BAR.vertices[:, 1]) < 0.2)
    angle = BAR.vertices[up, 0] / (3.0 / (np.pi / 2))
    wanted = np.stack([-np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
    assert np.degrees(np.arccos(np.clip((normals[up] * wanted).sum(axis=1), -1, 1))).max() < 4.0


def test_between_two_steps_a_skin_is_drawn_between(zoo):
    zoo.bar.set_velocity((1.0, 2.0, 3.0))
    zoo.world.step(0.01)
    early, late = zoo.draw(zoo.bar, 0.0)[0], zoo.draw(zoo.bar, 1.0)[0]
    np.testing.assert_allclose(late - early, np.tile([0.01, 0.02, 0.03], (len(late), 1)), atol=2e-6)
    np.testing.assert_allclose(zoo.draw(zoo.bar, 0.25)[0], 0.75 * early + 0.25 * late, atol=2e-6)


def test_one_thread_and_all_draw_the_same_bits(zoo, monkeypatch):
    put(zoo.blob, bent(zoo.blob.asset.mesh.vertices))
    found = []
    for fewest in (0, 10**9):
        monkeypatch.setattr(skin_mesh, "MIN_PARALLEL_VERTICES", fewest)
        found.append([rows.tobytes() for rows in zoo.draw(zoo.blob)])
    assert found[0] == found[1]


def test_a_skin_does_not_follow_a_cut_and_says_so(zoo):
    skin = zoo.carrier.render_meshes[0]
    assert not skin.is_outdated
    zoo.carrier.cut(plane=((8.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    assert skin.is_outdated
    with pytest.raises(StateError, match="cannot follow"):
        zoo.draw(skin)
    assert zoo.carrier.render_meshes == ()
    assert zoo.carrier.render_mesh().vertex_count > 0


def test_a_skin_does_not_follow_a_tear_and_says_so():
    asset = SoftBodyAsset.from_surface(BAR, JELLY, cells=10, tearing=Tearing(2e3), spare_vertices=200)
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(asset)
    world.build()
    (skin,) = body.render_meshes
    assert not skin.is_outdated
    places = body.positions()
    body.set_motion(places, 3.0 * np.sign(places) * (1.0, 0.0, 0.0))  # both halves away from the middle
    world.step(1 / 60)
    assert skin.is_outdated
    assert body.render_meshes == ()
    with pytest.raises(StateError, match=r"torn.*cannot follow"):
        world.read_render_mesh(skin, 1.0)


def test_names_textures_and_the_nearest_vertices_are_told(tmp_path):
    scene = trimesh.Scene()
    crate = trimesh.creation.box()
    crate.unmerge_vertices()
    uv = np.random.default_rng(0).random((len(crate.vertices), 2))
    crate.visual = trimesh.visual.TextureVisuals(uv=uv)
    scene.add_geometry(crate, node_name="crate")
    scene.export(tmp_path / "crate.glb")
    world = bare_world()
    body = world.add_body(
        SoftBodyAsset.from_surface(tmp_path / "crate.glb", JELLY, cells=4), position=(0, 0, 1)
    )
    (skin,) = body.render_meshes
    assert isinstance(skin, SkinMesh)
    assert "crate" in skin.name
    assert "crate" in repr(skin)
    np.testing.assert_allclose(skin.visual.uv, uv, atol=1e-6)
    near = body.asset.mesh.vertices[skin.body_vertices]
    assert np.linalg.norm(near - body.asset.skins[0].surface.vertices, axis=1).max() < 0.3


def test_bodies_of_one_asset_share_what_binds_their_skin(zoo):
    assert zoo.bar.asset.skins is zoo.bar.asset.skins


def test_where_there_is_no_skin_none_is_drawn(zoo):
    assert zoo.plain.render_meshes == ()
    with pytest.raises(OptionError, match="no skin"):
        zoo.draw(zoo.plain)


def test_a_rope_takes_no_skin_and_springs_no_cage():
    with pytest.raises(MeshError, match=r"skins.*no tetrahedra"):
        SoftBodyAsset(rope(1.0, 4, mass=0.1), SpringMaterial(500.0, 0.2), skin=ball())
    with pytest.raises(OptionError, match=r"law .* cage.*'virial'"):
        SoftBodyAsset.from_surface(ball(), JELLY, cells=4, law="springs")


def with_seams(mesh):
    """Return an .obj file in which each corner has its own texture coordinate and the facet's normal."""
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in mesh.vertices]
    lines += [f"vt {i / 7 % 1:.9f} {i / 11 % 1:.9f}" for i in range(3 * len(mesh.faces))]
    lines += [f"vn {x:.9f} {y:.9f} {z:.9f}" for x, y, z in mesh.face_normals]
    for i, face in enumerate(mesh.faces):
        lines.append("f " + " ".join(f"{v + 1}/{3 * i + k + 1}/{i + 1}" for k, v in enumerate(face)))
    return "\n".join(lines)


def test_vertices_that_are_split_at_seams_make_the_same_body_and_stay_together(tmp_path):
    bar = trimesh.creation.box((3.0, 0.6, 0.6)).subdivide().subdivide()
    (tmp_path / "bar.obj").write_text(with_seams(bar))
    split = SoftBodyAsset.from_surface(tmp_path / "bar.obj", JELLY, cells=6, up="z", hull=200)
    whole = SoftBodyAsset.from_surface(bar, JELLY, cells=6, hull=200)
    np.testing.assert_allclose(split.mesh.vertices, whole.mesh.vertices, atol=1e-8)
    np.testing.assert_array_equal(split.mesh.tets, whole.mesh.tets)
    np.testing.assert_allclose(split.hull.points, whole.hull.points, atol=1e-8)
    (skin,) = split.skins
    assert skin.vertex_count == 3 * len(bar.faces)
    facts = facts_of(split.skin)
    assert (facts.open_edges, facts.crowded_edges, facts.parts) == (0, 0, 1)
    world = bare_world(floor=None, gravity=(0, 0, 0))
    body = world.add_body(split)
    world.build()
    places = body.positions() + 0.1 * np.sin(3.0 * body.positions()[:, [1, 2, 0]])  # bent and twisted
    put(body, places)
    drawn, _ = world.read_render_mesh(body.render_meshes[0], 1.0)
    _, place = np.unique(skin.surface.vertices, axis=0, return_inverse=True)
    for number in np.unique(place):
        copies = drawn[place.reshape(-1) == number]
        assert (copies == copies[0]).all()


def test_what_was_assumed_and_repaired_of_a_file_is_logged(tmp_path, caplog):
    crate = trimesh.creation.box()
    lines = with_seams(crate).replace("vn ", "vn -").replace("vn --", "vn ")  # all of x the wrong way
    (tmp_path / "crate.obj").write_text("mtllib gone.mtl\n" + lines)
    with caplog.at_level("INFO", logger="taichi_soft"):
        SoftBodyAsset.from_surface(tmp_path / "crate.obj", JELLY, cells=3, center=True)
    warned = [record.message for record in caplog.records if record.levelname == "WARNING"]
    told = " ".join(warned)
    assert "no file 'gone.mtl' beside it" in told
    assert "12 of its 36 normals point away" in told
    assert "is now the origin" in told
    assert "y is taken as up, as in most .obj files" in caplog.text
    caplog.clear()
    with caplog.at_level("INFO", logger="taichi_soft"):
        SoftBodyAsset.from_surface(tmp_path / "crate.obj", JELLY, cells=3, up="y")
    assert "taken as up" not in caplog.text


def test_an_asset_and_options_of_its_own_do_not_go_together():
    asset = SoftBodyAsset(box((1, 1, 1), (1, 1, 1)), JELLY)
    world = bare_world()
    with pytest.raises(OptionError, match=r"material .*SoftBodyAsset"):
        world.add_body(asset, JELLY)
    with pytest.raises(OptionError, match=r"law .*SoftBodyAsset"):
        world.add_body(asset, law="face")
    body = world.add_body(asset, position=(0, 0, 1))
    assert body.asset is asset


def test_a_body_from_a_surface_falls_and_rests_on_its_floor():
    world = bare_world()
    soft = Material(1e5, 0.3, 1000.0, damping_ratio=0.3)
    body = world.add_body(SoftBodyAsset.from_surface(BAR, soft, cells=10), position=(0, 0, 0.32))
    world.build()
    for _ in range(180):
        world.step(1 / 60)
    lowest = world.read_render_mesh(body.render_meshes[0], 1.0)[0][:, 2].min()
    assert np.abs(body.velocities()).max() < 0.3
    assert abs(lowest) < 0.02 * 3.0  # relative to its size of 3
    assert body.flipped_count() == 0


def test_a_cage_is_in_a_recording_and_moves_the_same_again(tmp_path):
    asset = SoftBodyAsset.from_surface(BLOB, JELLY, cells=5)
    world = bare_world(record=10)
    world.add_body(asset, position=(0, 0, 1))
    world.build()
    for _ in range(20):
        world.step(1 / 60)
    report = replay(world.save_recording(tmp_path / "blob.recording"))
    assert report.steps == 10
    assert report.first_difference is None


def test_a_body_has_the_same_skin_meshes_each_time_they_are_asked_for(zoo):
    assert zoo.bar.render_meshes is zoo.bar.render_meshes
