"""Baked files, read by other readers and compared with the world at every frame."""

import json
import os
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from glb import Glb, z_up
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Material, OptionError, SoftBodyAsset, StateError, box, sphere
from taichi_soft.bake import bake
from taichi_soft.bake.gltf import GlbFile
from taichi_soft.core import extras
from taichi_soft.core.errors import BakeError, MissingExtraError
from taichi_soft.world.bare import bare_world

JELLY = Material(5e4, 0.4, 1000.0)
FPS, SECONDS, FRAMES = 30.0, 0.5, 16
COMES, GOES = 4, 9  # first frame with the ball, first frame without the block
PICTURE = (np.random.default_rng(3).random((8, 12, 3)) * 255).astype(np.uint8)


def textured_ring():
    """Make a ring with a seam: vertices at one position with different texture coordinates."""
    ring = trimesh.creation.torus(0.4, 0.15, major_sections=20, minor_sections=12)
    uv = np.random.default_rng(4).random((len(ring.vertices), 2))
    material = PBRMaterial(
        name="glaze", baseColorTexture=Image.fromarray(PICTURE), metallicFactor=0.0, roughnessFactor=0.4
    )
    made = trimesh.Trimesh(
        np.concatenate([ring.vertices, ring.vertices[:5]]),
        np.where(
            (ring.faces < 5) & (np.arange(len(ring.faces)) % 2 == 0)[:, None],
            ring.faces + len(uv),
            ring.faces,
        ),
        process=False,
        visual=TextureVisuals(uv=np.concatenate([uv, 0.5 * uv[:5]]), material=material),
    )
    made.metadata["name"] = "ring"
    return made


class Game:
    """A world to which a ball is added and from which a block is removed, with its state in each frame."""

    def __init__(self):
        self.skin = textured_ring()
        asset = SoftBodyAsset.from_surface(self.skin, JELLY, cells=6)
        world = self.world = bare_world(floor=0.0, retries=0)
        world.add_body(asset, position=(0, 0, 0.8), rotation=(0.3, 0.0, 0.0, np.sqrt(0.91)))
        world.add_body(asset, position=(1.2, 0, 0.4))
        self.block = world.add_body(box((0.4, 0.4, 0.4), cells=(2, 2, 2)), JELLY, position=(2.4, 0, 0.3))
        self.ball = SoftBodyAsset(sphere(0.3, 4), JELLY, spare_vertices=60)
        world.reserve(self.ball, 2)
        world.build()
        self.base = world.snapshot()
        self.cut_at = None
        self.begin()

    def begin(self):
        self.world.restore(self.base)
        self.steps = 0
        self.seen = []
        self.meshes = {}
        return EngineAdapter(self.world, FixedStep(1 / 60), before_step=self.play)

    def play(self, world):
        self.steps += 1  # two to a frame
        if self.steps == 2 * COMES:
            world.spawn(self.ball, position=(0, 1.2, 0.5), velocity=(0, 0, -1))
        if self.steps == 2 * GOES:
            world.despawn(world.bodies[2])
        if self.steps == self.cut_at:
            body = world.bodies[-1]
            body.cut(plane=(body.positions().mean(axis=0), (0, 0, 1)))

    def look(self, made, total):
        """Record the current meshes, by the names that the files must contain."""
        names = ["ring", "ring_2", "body_2", "body_3"]
        frame = {}
        for body in self.world.bodies:
            if body.index not in self.meshes:
                self.meshes[body.index] = (body.render_meshes or (body.render_mesh(),))[0]
            frame[names[body.index]] = self.world.read_render_mesh(self.meshes[body.index], 1.0)
        self.seen.append(frame)

    def bake(self, path, **options):
        adapter = self.begin()
        report = bake(adapter, path, seconds=SECONDS, fps=FPS, on_frame=self.look, **options)
        assert (report.frames, report.path, len(self.seen)) == (FRAMES, path, FRAMES)
        assert set(report.meshes) == {"ring", "ring_2", "body_2", "body_3"}
        return report


@pytest.fixture(scope="module")
def game():
    return Game()


@pytest.fixture(scope="module")
def baked(game, tmp_path_factory):
    """Bake the same game in all formats. Return the files and the state in each frame."""
    folder = tmp_path_factory.mktemp("baked")
    for name in ("play.glb", "play.npz", "play.vat", "play.usdc"):
        game.bake(folder / name)
    return folder, list(game.seen)


def frames_of(seen, name):
    return [frame for frame, shown in enumerate(seen) if name in shown]


def test_the_bodies_move_come_and_go(baked):
    _, seen = baked
    assert frames_of(seen, "body_2") == list(range(GOES))
    assert frames_of(seen, "body_3") == list(range(COMES, FRAMES))
    assert np.ptp([shown["ring"][0] for shown in seen], axis=0).max() > 0.3
    assert frames_of(seen, "ring_2") == list(range(FRAMES))


@pytest.mark.parametrize("interpolation", ["linear", "step"])
def test_base_and_weights_times_targets_are_the_worlds_positions_and_normals(game, tmp_path, interpolation):
    game.bake(tmp_path / "play.glb", interpolation=interpolation)
    glb = Glb(tmp_path / "play.glb")
    for name in ("ring", "ring_2", "body_2", "body_3"):
        assert glb.channel(name, "weights")[2] == interpolation.upper()
        for frame in frames_of(game.seen, name):
            positions, normals = game.seen[frame][name]
            time = np.float32(frame / FPS)
            np.testing.assert_allclose(z_up(glb.shape(name, time)), positions, rtol=0, atol=1e-6)
            np.testing.assert_allclose(z_up(glb.shape(name, time, "NORMAL")), normals, rtol=0, atol=1e-6)


def test_between_two_frames_a_glb_shows_their_mean_or_the_first(game, tmp_path):
    time = np.float32(6.5 / FPS)
    for interpolation, share in (("linear", 0.5), ("step", 0.0)):
        game.bake(tmp_path / "play.glb", interpolation=interpolation)
        before, after = (game.seen[frame]["ring"][0].astype(float) for frame in (6, 7))
        shown = z_up(Glb(tmp_path / "play.glb").shape("ring", time))
        np.testing.assert_allclose(shown, (1 - share) * before + share * after, rtol=0, atol=1e-6)


def test_what_is_not_in_the_world_has_no_size_in_a_glb(baked):
    glb = Glb(baked[0] / "play.glb")
    times, sizes, interpolation = glb.channel("body_2", "scale")
    assert interpolation == "STEP"
    np.testing.assert_array_equal(sizes, [[1, 1, 1], [0, 0, 0]])
    np.testing.assert_allclose(times, [0, GOES / FPS], rtol=1e-6)
    times, sizes, _ = glb.channel("body_3", "scale")
    np.testing.assert_array_equal(sizes, [[0, 0, 0], [1, 1, 1]])
    np.testing.assert_allclose(times, [0, COMES / FPS], rtol=1e-6)
    assert glb.channel("ring", "scale") is None


def test_trimesh_reads_the_first_frame_with_coordinates_picture_and_material(game, baked):
    folder, seen = baked
    scene = trimesh.load_scene(folder / "play.glb", process=False, maintain_order=True)
    for name in ("ring", "ring_2"):
        mesh = scene.geometry[name]
        np.testing.assert_array_equal(z_up(mesh.vertices), seen[0][name][0])
        np.testing.assert_array_equal(mesh.faces, game.skin.faces)
        np.testing.assert_allclose(mesh.visual.uv, game.skin.visual.uv, atol=1e-6)
        material = mesh.visual.material
        assert (material.name, material.metallicFactor, material.roughnessFactor) == ("glaze", 0.0, 0.4)
        np.testing.assert_array_equal(np.asarray(material.baseColorTexture.convert("RGB")), PICTURE)
    plain = scene.geometry["body_2"].visual.material
    assert plain.metallicFactor == 0.0  # the default of glTF would be metal


VALIDATOR = Path(os.environ.get("GLTF_VALIDATOR", Path(__file__).parents[2] / "out/node"))
VALIDATE = """
const validator = require("gltf-validator"), fs = require("fs");
const bytes = new Uint8Array(fs.readFileSync(process.argv[1]));
validator.validateBytes(bytes).then((report) => console.log(JSON.stringify(report)));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.skipif(
    not (VALIDATOR / "node_modules/gltf-validator").is_dir(),
    reason="needs Khronos' validator: npm install --prefix out/node gltf-validator@2.0.0-dev.3.10",
)
@pytest.mark.parametrize("name", ["play.glb", "play.vat/mesh.glb"])
def test_khronos_validator_finds_no_error_and_no_warning(baked, name):
    done = subprocess.run(
        ["node", "-e", VALIDATE, str(baked[0] / name)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NODE_PATH": str(VALIDATOR / "node_modules")},
    )
    report = json.loads(done.stdout)
    assert (report["issues"]["numErrors"], report["issues"]["numWarnings"]) == (0, 0), report["issues"]
    assert report["info"]["animationCount"] == (name == "play.glb")


def test_a_point_cache_holds_the_worlds_numbers(game, baked):
    folder, seen = baked
    with np.load(folder / "play.npz") as cache:
        held = dict(cache)
    assert held["names"].tolist() == ["ring", "ring_2", "body_2", "body_3"]
    np.testing.assert_allclose(held["times"], np.arange(FRAMES) / 30)
    assert held["positions"].dtype == held["normals"].dtype == np.float32
    for mesh, name in enumerate(held["names"]):
        rows = slice(*held["vertex_starts"][mesh : mesh + 2])
        assert np.flatnonzero(held["is_there"][:, mesh]).tolist() == frames_of(seen, name)
        for frame in frames_of(seen, name):
            np.testing.assert_array_equal(held["positions"][frame, rows], seen[frame][name][0])
            np.testing.assert_array_equal(held["normals"][frame, rows], seen[frame][name][1])
    ring = slice(*held["triangle_starts"][1:3])
    np.testing.assert_array_equal(held["triangles"][ring] - held["vertex_starts"][1], game.skin.faces)
    count = len(game.skin.vertices)
    np.testing.assert_allclose(held["uvs"][count : 2 * count], game.skin.visual.uv, atol=1e-6)
    assert np.isnan(held["uvs"][2 * count :]).all()


class Vat:
    """A vertex-animation texture as its shaders read it, in float64."""

    def __init__(self, folder):
        self.facts = json.loads((folder / "metadata.json").read_text())
        self.high, self.low, self.normal = (
            cv2.imread(str(folder / f"{name}.png"), cv2.IMREAD_UNCHANGED)[..., ::-1].astype(np.float64)
            for name in ("position_high", "position_low", "normal")
        )
        self.lowest, self.highest = (np.array(self.facts[key]) for key in ("lowest", "highest"))
        self.half_step = (self.highest - self.lowest) / 65535 / 2
        self.mesh = Glb(folder / "mesh.glb")

    def shape(self, name, frame):
        """Return positions and normals, y up, located by the second texture coordinates of the mesh."""
        uv = self.mesh.array(self.mesh.primitive(name)["attributes"]["TEXCOORD_1"]).astype(np.float64)
        rows = self.facts["rows_per_frame"]
        column = (uv[:, 0] * self.high.shape[1]).astype(int)
        row = frame * rows + (uv[:, 1] * rows).astype(int)
        share = (256 * self.high[row, column] + self.low[row, column]) / 65535
        place = self.lowest + (self.highest - self.lowest) * share
        return place, self.normal[row, column] / 255 * 2 - 1


def test_a_vertex_texture_is_the_world_to_half_a_step_of_its_levels(baked):
    folder, seen = baked
    vat = Vat(folder / "play.vat")
    assert vat.high.shape == (vat.facts["height"], vat.facts["width"], 3)
    assert vat.facts["frame_count"] == FRAMES
    assert vat.half_step.max() < 3e-5
    for name in seen[0]:
        for frame in frames_of(seen, name):
            place, normal = vat.shape(name, frame)
            positions, normals = seen[frame][name]
            most = np.abs(z_up(vat.half_step[None])) + 1e-7  # of float32
            assert (np.abs(z_up(place) - positions) <= most).all()
            assert np.abs(z_up(normal) - normals).max() <= 1 / 255 + 1e-6


def test_what_is_not_in_the_world_is_one_point_of_a_vertex_texture(baked):
    vat = Vat(baked[0] / "play.vat")
    for name, hidden in (("body_2", range(GOES, FRAMES)), ("body_3", range(COMES))):
        for frame in hidden:
            assert (np.ptp(vat.shape(name, frame)[0], axis=0) == 0).all()
        assert np.ptp(vat.shape(name, COMES)[0], axis=0).min() > 0.3


def test_shaders_have_the_numbers_of_the_bake(baked):
    folder = baked[0] / "play.vat"
    facts = json.loads((folder / "metadata.json").read_text())
    for name in ("godot.gdshader", "godot3.shader", "unity.hlsl"):
        text = (folder / name).read_text()
        assert "@" not in text
        assert f"= {FRAMES};" in text
        assert "= 30.0;" in text
        assert ", ".join(f"{value:.9g}" for value in facts["lowest"]) in text


def test_usd_reads_the_worlds_points_at_every_time_code(game, baked):
    from pxr import Usd, UsdGeom

    folder, seen = baked
    stage = Usd.Stage.Open(str(folder / "play.usdc"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, FRAMES - 1)
    assert stage.GetTimeCodesPerSecond() == FPS
    for name in ("ring", "ring_2", "body_2", "body_3"):
        mesh = UsdGeom.Mesh.Get(stage, f"/bake/{name}")
        for frame in range(FRAMES):
            is_seen = mesh.ComputeVisibility(frame) != "invisible"
            assert is_seen == (name in seen[frame])
            if is_seen:
                np.testing.assert_array_equal(mesh.GetPointsAttr().Get(frame), seen[frame][name][0])
                np.testing.assert_array_equal(mesh.GetNormalsAttr().Get(frame), seen[frame][name][1])
    ring = UsdGeom.Mesh.Get(stage, "/bake/ring")
    np.testing.assert_array_equal(
        np.array(ring.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3), game.skin.faces
    )
    uv = UsdGeom.PrimvarsAPI(ring).GetPrimvar("st").Get()
    np.testing.assert_allclose(uv, game.skin.visual.uv, atol=1e-6)


def test_a_cut_is_refused_with_its_frame_and_what_was_there_stays(game, tmp_path):
    path = tmp_path / "play.glb"
    path.write_text("of yesterday")
    game.cut_at = 21  # within frame 11, as two steps make a frame
    try:
        with pytest.raises(
            StateError,
            match=r"'body_3'.*frame 11.*0\.333333 s",
        ):
            game.bake(path)
        bake(game.begin(), path, seconds=0.333333, fps=FPS)
    finally:
        game.cut_at = None
    assert [each.name for each in tmp_path.iterdir()] == ["play.glb"]
    assert len(Glb(path).channel("body_3", "weights")[0]) == 11 - COMES


def test_a_write_that_fails_leaves_what_was_there(game, tmp_path, monkeypatch):
    def save(self, path):
        path.write_bytes(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(GlbFile, "save", save)
    for name in ("play.glb", "play.vat"):
        with pytest.raises(BakeError, match=f"{name}: No space left on device"):
            bake(game.begin(), tmp_path / name, seconds=0.1)
    assert list(tmp_path.iterdir()) == []


def test_a_second_bake_replaces_the_first(game, tmp_path):
    for frames in (3, 5):
        for name in ("play.glb", "play.vat"):
            bake(game.begin(), tmp_path / name, seconds=(frames - 1) / 30)
        (tmp_path / "play.vat/normal.png.import").write_text("settings of an engine")
    assert len(Glb(tmp_path / "play.glb").channel("ring", "weights")[0]) == 5
    assert Vat(tmp_path / "play.vat").facts["frame_count"] == 5
    assert sorted(each.name for each in tmp_path.iterdir()) == ["play.glb", "play.vat"]
    assert (tmp_path / "play.vat/normal.png.import").read_text() == "settings of an engine"


def test_folders_and_files_of_something_else_stay(game, tmp_path):
    for name in ("work.vat", "work.glb"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "thesis.tex").write_text("years")
        with pytest.raises(BakeError, match=r"not a \.vat"):
            bake(game.begin(), tmp_path / name, seconds=0.1)
        assert (tmp_path / name / "thesis.tex").read_text() == "years"
    (tmp_path / "file.vat").write_text("years")
    with pytest.raises(BakeError, match=r"a \.vat is a folder"):
        bake(game.begin(), tmp_path / "file.vat", seconds=0.1)
    assert (tmp_path / "file.vat").read_text() == "years"


@pytest.mark.parametrize(
    ("name", "options", "reason"),
    [
        ("a.fbx", {}, r"ends in \.glb, \.npz, \.vat, \.usdc"),
        (".glb", {}, "ends in"),
        ("a.glb", {"seconds": 0}, "seconds.*above 0 s"),
        ("a.glb", {"fps": float("nan")}, "fps must be"),
        (
            "a.glb",
            {"fps": 25},
            r"0\.0166667 s.*60, 30, 20, 15.*1 / 75",
        ),
        ("a.glb", {"fps": 120}, "use 60"),
        ("a.glb", {"interpolation": "cubic"}, "'linear' or 'step'"),
        (
            "a.glb",
            {"limit": 0.1},
            r"61 frames.* MB.*0\.1 MB.*vat",
        ),
        ("a.glb", {"seconds": 2e4, "limit": 1e6}, "4 GiB of a .glb"),
        (
            "a.vat",
            {"seconds": 600, "limit": 1e6},
            "18,001 rows.*at most 16,384",
        ),
        ("a.npz", {"seconds": 1e9}, "at most"),
    ],
)
def test_what_cannot_be_baked_is_refused_before_anything_moves(game, tmp_path, name, options, reason):
    adapter = game.begin()
    with pytest.raises(OptionError, match=reason):
        bake(adapter, tmp_path / name, **{"seconds": 2, "fps": 30, **options})
    assert game.world.step_count == 0
    assert list(tmp_path.iterdir()) == []


def test_a_body_that_comes_later_counts_towards_the_limit(game, tmp_path):
    adapter, rooms = game.begin(), []
    bake(adapter, tmp_path / "a.npz", seconds=SECONDS, on_room=rooms.append)
    with pytest.raises(OptionError, match="above the limit"):
        bake(game.begin(), tmp_path / "b.npz", seconds=SECONDS, limit=rooms[0].size / 1e6)
    assert len(rooms) == 1
    assert game.world.step_count == 2 * COMES
    assert [each.name for each in tmp_path.iterdir()] == ["a.npz"]


def test_a_missing_package_is_named_before_anything_moves(game, tmp_path, monkeypatch):
    adapter = game.begin()
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"\.glb.*pygltflib, pillow.*taichi-soft\[bake\]"):
        bake(adapter, tmp_path / "a.glb", seconds=1)
    with pytest.raises(MissingExtraError, match=r"a \.usdc file needs usd-core.*taichi-soft\[usd\]"):
        bake(adapter, tmp_path / "a.usdc", seconds=1)
    assert game.world.step_count == 0


def test_what_is_no_scene_is_refused(tmp_path):
    with pytest.raises(OptionError, match=r"World.*EngineAdapter, got str"):
        bake("world", tmp_path / "a.npz", seconds=1)


@pytest.mark.parametrize(("fps", "steps"), [(24, 3), (30, 2), (60, 1), (100, 1), (29.97, 3)])
def test_a_world_by_itself_makes_whole_steps_of_at_most_a_sixtieth_from_frame_to_frame(
    game, tmp_path, fps, steps
):
    game.begin()
    bake(game.world, tmp_path / "a.npz", seconds=2 / fps, fps=fps)
    assert game.world.step_count == 2 * steps
    assert game.world.time == pytest.approx(2 / fps)
    assert game.world.last_dt <= 1 / 60 + 1e-9


@pytest.mark.soak
def test_a_body_that_goes_and_is_restored_is_seen_when_it_was_there(tmp_path):
    """After its restoration, the body has a separate clip, so that its two motions are not merged."""
    world, kept, heights = bare_world(), [], []
    kind = SoftBodyAsset(box((0.3, 0.3, 0.3), (2, 2, 2)), Material(8e4, 0.4, 900.0))
    world.reserve(kind, 2)
    world.spawn(kind, position=(0, 0, 0.3))
    other = world.spawn(kind, position=(1, 0, 5.0))
    world.build()

    def go_and_come(world):
        if world.step_count == 6 and not kept:
            kept.append(world.snapshot())
            world.despawn(other)
        elif world.step_count == 20 and len(world.bodies) == 1:
            world.restore(kept[0])

    def look(*_):
        heights.append(float(other.positions()[:, 2].mean()) if other.is_alive else np.nan)

    game = EngineAdapter(world, FixedStep(1 / 60), before_step=go_and_come)
    bake(game, tmp_path / "play.npz", seconds=1.0, on_frame=look)
    found = np.load(tmp_path / "play.npz")
    rows = [found["positions"][:, a:b, 2].mean(axis=1) for a, b in pairwise(found["vertex_starts"])]
    seen = np.full(len(heights), np.nan)
    for clip in (1, 2):
        there = found["is_there"][:, clip]
        seen[there] = rows[clip][there]
    np.testing.assert_allclose(seen, heights, atol=0.02)  # corners count more where edges are drawn sharp
