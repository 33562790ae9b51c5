"""Contents of baked files, from made-up clips without a world."""

import json

import cv2
import numpy as np
import pytest
import trimesh
from glb import Glb, z_up
from PIL import Image
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import SimpleMaterial

from taichi_soft.bake.clip import Clip, Take
from taichi_soft.bake.gltf import write_glb
from taichi_soft.bake.usd import write_usd
from taichi_soft.bake.vertex_texture import WIDEST, write_vat

pytestmark = pytest.mark.numpy


def clip_of(vertices, shapes, *, name="clip", visual=None, first=0):
    """Make a clip of a triangle fan. `shapes` are the indices of its shapes in each frame."""
    generator = np.random.default_rng(7)
    positions = generator.standard_normal((max(shapes) + 1, vertices, 3)).astype(np.float32)
    normals = generator.standard_normal(positions.shape)
    normals = (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)
    corner = np.arange(1, vertices - 1)
    triangles = np.stack([np.zeros_like(corner), corner, corner + 1], axis=1).astype(np.int32)
    clip = Clip(name, triangles, visual, first)
    for shape in shapes:
        clip.add(positions[shape].copy(), normals[shape].copy())
    return clip


def take_of(*clips):
    return Take(clips, max(clip.end for clip in clips), 10.0, ())


def test_frames_in_which_nothing_moves_share_one_target(tmp_path):
    clip = clip_of(5, [0, 0, 1, 1, 1, 2, 2])
    write_glb(take_of(clip), tmp_path / "a.glb", "linear")
    glb = Glb(tmp_path / "a.glb")
    assert len(glb.primitive("clip")["targets"]) == 2
    for frame, rows in enumerate(clip.positions):
        np.testing.assert_allclose(z_up(glb.shape("clip", np.float32(frame / 10))), rows, atol=1e-6)


def test_what_never_moves_has_neither_targets_nor_an_animation(tmp_path):
    write_glb(take_of(clip_of(5, [0, 0, 0])), tmp_path / "a.glb", "linear")
    glb = Glb(tmp_path / "a.glb")
    assert "targets" not in glb.primitive("clip")
    assert "animations" not in glb.json


def test_clips_that_move_alike_share_times_and_weights(tmp_path):
    clips = [clip_of(count, range(20), name=f"clip {count}") for count in (5, 6, 7)]
    write_glb(take_of(*clips), tmp_path / "a.glb", "linear")
    (animation,) = Glb(tmp_path / "a.glb").json["animations"]
    assert len(animation["channels"]) == 3
    assert len({(sampler["input"], sampler["output"]) for sampler in animation["samplers"]}) == 1


def test_a_mesh_wider_than_a_texture_takes_several_rows_a_frame(tmp_path):
    clips = [clip_of(3000, [0, 1, 2], name="one"), clip_of(2500, [3, 4, 5], name="other")]
    write_vat(take_of(*clips), tmp_path / "a.vat")
    facts = json.loads((tmp_path / "a.vat/metadata.json").read_text())
    high, low = (
        cv2.imread(str(tmp_path / f"a.vat/position_{part}.png"), cv2.IMREAD_UNCHANGED)[..., ::-1].astype(
            float
        )
        for part in ("high", "low")
    )
    assert (facts["rows_per_frame"], high.shape) == (2, (6, WIDEST, 3))
    glb = Glb(tmp_path / "a.vat/mesh.glb")
    lowest, highest = np.array(facts["lowest"]), np.array(facts["highest"])
    half = np.abs(z_up((highest - lowest)[None])) / 65535 / 2 + 1e-6
    for clip in clips:
        uv = glb.array(glb.primitive(clip.name)["attributes"]["TEXCOORD_1"]).astype(float)
        column, row = (uv[:, 0] * WIDEST).astype(int), (uv[:, 1] * 2).astype(int)
        for frame in range(3):
            levels = 256 * high[2 * frame + row, column] + low[2 * frame + row, column]
            place = lowest + (highest - lowest) * levels / 65535
            assert (np.abs(z_up(place) - clip.positions[frame]) <= half).all()


def test_the_picture_of_an_obj_is_not_darkened_and_not_metal(tmp_path):
    """For a material without a colour, trimesh writes grey, and glTF multiplies the texture by it."""
    picture = Image.fromarray(np.full((4, 4, 3), 200, dtype=np.uint8))
    visual = TextureVisuals(uv=np.zeros((5, 2)), material=SimpleMaterial(image=picture))
    write_glb(take_of(clip_of(5, [0, 1], visual=visual)), tmp_path / "a.glb", "linear")
    (material,) = Glb(tmp_path / "a.glb").json["materials"]
    looks = material["pbrMetallicRoughness"]
    assert looks.get("baseColorFactor", [1, 1, 1, 1]) == [1, 1, 1, 1]
    assert looks["metallicFactor"] == 0
    assert "baseColorTexture" in looks


def test_the_colour_of_an_obj_is_kept(tmp_path):
    visual = TextureVisuals(material=SimpleMaterial(diffuse=(255, 51, 0, 255)))
    write_glb(take_of(clip_of(5, [0, 1], visual=visual)), tmp_path / "a.glb", "linear")
    (material,) = Glb(tmp_path / "a.glb").json["materials"]
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([1, 0.2, 0, 1])


@pytest.mark.parametrize("kind", ["vertex", "face"])
def test_colours_of_vertices_or_triangles_are_kept(tmp_path, kind):
    clip = clip_of(5, [0, 1])
    colors = np.array([[200, 10, 30, 255]], dtype=np.uint8)
    mesh = trimesh.Trimesh(clip.positions[0], clip.triangles, process=False)
    rows = np.repeat(colors, 5 if kind == "vertex" else len(clip.triangles), 0)
    clip.visual = ColorVisuals(mesh, **{f"{kind}_colors": rows})
    write_glb(take_of(clip), tmp_path / "a.glb", "linear")
    glb = Glb(tmp_path / "a.glb")
    held = glb.array(glb.primitive("clip")["attributes"]["COLOR_0"])
    np.testing.assert_array_equal(held, np.repeat(colors, 5, 0))
    assert glb.json["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] == 0


ODD = ("world", "a.b", "a_b", "1", "Äpfel", "")


def test_meshes_keep_whatever_name_they_have_in_a_glb(tmp_path):
    clips = [clip_of(5 + number, [0, 1], name=name) for number, name in enumerate(ODD[:-1])]
    write_glb(take_of(*clips), tmp_path / "a.glb", "linear")
    glb = Glb(tmp_path / "a.glb")
    for clip in clips:
        np.testing.assert_allclose(z_up(glb.shape(clip.name, 0.1)), clip.positions[1], atol=1e-6)


def test_usd_gives_every_mesh_a_name_that_it_takes(tmp_path):
    from pxr import Usd, UsdGeom

    clips = [clip_of(5 + number, [0, 1], name=name) for number, name in enumerate(ODD)]
    write_usd(take_of(*clips), tmp_path / "a.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert [len(mesh.GetPointsAttr().Get(0)) for mesh in meshes] == list(range(5, 11))
    assert [mesh.GetPrim().GetName() for mesh in meshes[:4]] == ["world", "a_b", "a_b_2", "_1"]


def test_clips_of_the_same_material_share_its_picture(tmp_path):
    picture = Image.fromarray(np.full((4, 4, 3), 200, dtype=np.uint8))
    visual = TextureVisuals(uv=np.zeros((5, 2)), material=SimpleMaterial(image=picture))
    clips = [clip_of(5, [0, 1], name=name, visual=visual) for name in "ab"]
    write_glb(take_of(*clips), tmp_path / "a.glb", "linear")
    tree = Glb(tmp_path / "a.glb").json
    assert len(tree["images"]) == len(tree["materials"]) == 1
