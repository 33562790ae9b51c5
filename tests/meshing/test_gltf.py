"""glTF files written byte by byte: every kind of content is read according to the specification."""

import base64
import contextlib
import copy
import io
import re
import sys
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
from gltf_writer import FACES, TETRAHEDRON, GltfWriter

from taichi_soft import MeshError
from taichi_soft.meshing.surfaces import read_surfaces

pytestmark = pytest.mark.numpy

HALF = np.sqrt(0.5)
TARGET = TETRAHEDRON * np.float32(2) + np.float32(1)


def read(writer, path):
    """The surfaces of a file in its own axes."""
    return read_surfaces(writer.write(path), up="z")


def one(writer, path):
    (surface,) = read(writer, path)
    return surface


def volume(surface):
    a, b, c = np.moveaxis(surface.vertices[surface.triangles], 1, 0)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def simple(**node):
    writer = GltfWriter()
    writer.node(mesh=writer.mesh(), **node)
    return writer


def refusal(path):
    with pytest.raises(MeshError) as caught:
        read_surfaces(path)
    message = str(caught.value)
    assert message.startswith(f"{path.name}: ")
    assert "\n" not in message
    return message


@pytest.fixture
def path(tmp_path):
    return tmp_path / "x.glb"


@pytest.mark.parametrize(
    ("name", "uri", "beside"),
    [
        ("x.glb", None, None),
        ("x.gltf", None, None),
        ("x.gltf", "my%20duck%C3%A9.bin", "my duck\u00e9.bin"),
        ("x.gltf", "my duck.bin", "my duck.bin"),
        ("x.gltf", "50%25.bin", "50%.bin"),
        ("x.gltf", "50%25.bin", "50%25.bin"),
        ("x.gltf", "../x.bin", "../x.bin"),
    ],
)
def test_vertices_and_triangles_come_as_they_are_stored_wherever_the_buffer_is(tmp_path, name, uri, beside):
    writer = simple()
    folder = tmp_path / "a"
    folder.mkdir()
    if beside:
        (folder / beside).write_bytes(writer.blob)
    (found,) = read_surfaces(writer.write(folder / name, uri), up="z")
    np.testing.assert_array_equal(found.vertices, TETRAHEDRON)
    np.testing.assert_array_equal(found.triangles, FACES)
    assert found.notes == ()


def test_y_of_the_file_is_up(path):
    (found,) = read_surfaces(simple(translation=[0, 5, 0]).write(path))
    np.testing.assert_array_equal(
        found.vertices, TETRAHEDRON @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]] + [0, 0, 5]
    )


def test_interleaved_attributes_are_read_by_their_stride_and_offset(path):
    writer, rows = GltfWriter(), np.zeros(4, [("position", "f4", 3), ("uv", "f4", 2)])
    rows["position"], rows["uv"] = TETRAHEDRON, TETRAHEDRON[:, :2]
    view = writer.view(b"pad!" + rows.tobytes(), byteStride=20)
    position = writer.add(
        "accessors", bufferView=view, byteOffset=4, componentType=5126, type="VEC3", count=4
    )
    uv = writer.add("accessors", bufferView=view, byteOffset=16, componentType=5126, type="VEC2", count=4)
    writer.node(mesh=writer.mesh(position, attributes={"TEXCOORD_0": uv}))
    found = one(writer, path)
    np.testing.assert_array_equal(found.vertices, TETRAHEDRON)
    np.testing.assert_array_equal(found.visual.uv, TETRAHEDRON[:, :2] * [1, -1] + [0, 1])


@pytest.mark.parametrize(
    ("dtype", "largest"), [("i1", 127), ("u1", 255), ("i2", 32767), ("u2", 65535), ("f4", None)]
)
@pytest.mark.parametrize("normalized", [True, False])
def test_quantised_positions_are_whole_numbers_or_shares_of_one(path, dtype, largest, normalized):
    writer = GltfWriter()
    rows = np.round(TETRAHEDRON * (largest or 1)).astype(dtype)
    if dtype[0] == "i":
        rows[0] = np.iinfo(dtype).min  # this value also stands for -1
    writer.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    position = writer.accessor(rows, normalized=normalized and dtype != "f4")
    writer.node(mesh=writer.mesh(position), scale=[2, 2, 2])
    wanted = np.maximum(rows / (largest or 1), -1.0) if normalized else rows.astype(float)
    np.testing.assert_allclose(one(writer, path).vertices, 2 * wanted, rtol=1e-15)


@pytest.mark.parametrize("over", ["rows", "zeros"])
def test_sparse_rows_replace_those_of_the_accessor(path, over):
    writer, moved = GltfWriter(), np.array([[7, 8, 9], [4, 5, 6]], np.float32)
    sparse = {
        "count": 2,
        "indices": {"bufferView": writer.view(np.array([3, 1], np.uint8).tobytes()), "componentType": 5121},
        "values": {"bufferView": writer.view(moved.tobytes())},
    }
    position = writer.accessor(TETRAHEDRON, sparse=sparse)
    wanted = TETRAHEDRON.copy()
    if over == "zeros":
        del writer.json["accessors"][position]["bufferView"]
        wanted[:] = 0
    wanted[[3, 1]] = moved
    writer.node(mesh=writer.mesh(position))
    np.testing.assert_array_equal(one(writer, path).vertices, wanted)


def test_nodes_move_what_is_below_them_by_matrix_or_by_scale_then_rotation_then_translation(path):
    """A quarter turn about z after a scale of 2 in x; a matrix, columns first, that moves by (0, 0, 9)."""
    writer = GltfWriter()
    child = writer.node(
        False, mesh=writer.mesh(), translation=[10, 0, 0], rotation=[0, 0, HALF, HALF], scale=[2, 1, 1]
    )
    writer.node(children=[child], matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 9, 1])
    x, y, z = TETRAHEDRON.T
    np.testing.assert_allclose(
        one(writer, path).vertices, np.stack([10 - y, 2 * x, z + 9], axis=1), atol=1e-15
    )


def test_mirrored_meshes_keep_facing_outwards_and_normals_stand_on_their_faces(path):
    """Normals are not vectors: under a scale of (-3, 1, 1) that of the sloping face turns to (-1/3, 1, 1)."""
    corners = TETRAHEDRON[FACES].reshape(-1, 3)
    flat = np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3])
    normals = np.repeat(flat / np.linalg.norm(flat, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    writer = GltfWriter()
    writer.node(mesh=writer.mesh(corners, None, attributes={"NORMAL": normals}), scale=[-3, 1, 1])
    found = one(writer, path)
    assert volume(found) == pytest.approx(3 / 6)
    a, b, c = np.moveaxis(found.vertices[found.triangles], 1, 0)
    across = np.cross(b - a, c - a)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    np.testing.assert_allclose(found.normals[found.triangles[:, 0]], across, atol=1e-6)
    np.testing.assert_allclose(found.normals[-1], np.array([-1 / 3, 1, 1]) / np.sqrt(19 / 9), atol=1e-6)


def skinned():
    """A bar along x with two joints.

    The second joint is bound at x = 1. At rest it is 1 higher and rotated by 90 degrees about z. The position
    of the mesh's node must have no effect.
    """
    writer = GltfWriter()
    bind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    bind[1, 0, 3] = -1.0
    positions = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 0.5, 0]], np.float32)
    joints = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 9]], np.uint8)
    weights = np.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], np.float32)
    mesh = writer.mesh(
        positions,
        attributes={"JOINTS_0": joints, "WEIGHTS_0": weights, "NORMAL": np.eye(3)[[1, 1, 1, 1]].astype("f4")},
    )
    tip = writer.node(False, translation=[1, 1, 0], rotation=[0, 0, HALF, HALF])
    root = writer.node(children=[tip], translation=[0, 0, 4])
    matrices = writer.accessor(bind.transpose(0, 2, 1).reshape(2, 16))
    skin = writer.add("skins", joints=[root, tip], inverseBindMatrices=matrices)
    writer.node(mesh=mesh, skin=skin, translation=[100, 100, 100])
    return writer


def test_a_skin_puts_vertices_where_its_joints_rest(path):
    found = one(skinned(), path)
    wanted = [[0, 0, 4], [1, 0.5, 4], [1, 2, 4], [0.5, 2, 4]]
    np.testing.assert_allclose(found.vertices, wanted, atol=1e-6)
    np.testing.assert_allclose(found.normals[[0, 2]], [[0, 1, 0], [-1, 0, 0]], atol=1e-6)


def test_weights_of_a_second_set_count_and_their_sum_is_one(path):
    writer = skinned()
    attributes = writer.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_1"] = writer.accessor(np.ones((4, 4), np.uint16))
    attributes["WEIGHTS_1"] = writer.accessor(
        np.tile(np.array([255, 0, 0, 0], np.uint8), (4, 1)), normalized=True
    )
    np.testing.assert_allclose(one(writer, path).vertices[0], [0.5, 0, 4], atol=1e-6)


@pytest.mark.parametrize("of", ["mesh", "node"])
def test_morph_targets_are_blended_by_the_weights_of_the_node_or_else_of_the_mesh(path, of):
    writer = GltfWriter()
    zeros = writer.accessor(np.zeros((4, 3), np.float32))
    targets = [
        {
            "POSITION": writer.accessor(TARGET),
            "NORMAL": writer.accessor(np.tile(np.float32([1, 0, 0]), (4, 1))),
        },
        {"POSITION": zeros},
    ]
    up = np.tile(np.float32([0, 0, 1]), (4, 1))
    mesh = writer.mesh(weights=[0.25, 1], attributes={"NORMAL": up}, targets=targets)
    writer.node(mesh=mesh, **({"weights": [1, 1]} if of == "node" else {}))
    found, weight = one(writer, path), {"mesh": 0.25, "node": 1.0}[of]
    np.testing.assert_allclose(found.vertices, TETRAHEDRON + weight * TARGET)
    np.testing.assert_allclose(found.normals, np.array([[weight, 0, 1]] * 4) / np.hypot(weight, 1), atol=1e-6)
    assert found.notes == ("1 primitive with morph targets, blended by the file's default weights",)


def test_instances_stand_where_their_attributes_say_within_the_node(path):
    writer = GltfWriter()
    places = writer.accessor(np.array([[1, 0, 0], [0, 2, 0]], np.float32))
    turned = writer.accessor(np.array([[0, 0, 0, 127], [0, 0, 90, 90]], np.int8), normalized=True)
    sizes = writer.accessor(np.array([[1, 1, 1], [3, 1, -1]], np.float32))
    instancing = {"attributes": {"TRANSLATION": places, "ROTATION": turned, "SCALE": sizes, "_ID": places}}
    mesh = writer.mesh(attributes={"COLOR_0": np.eye(4, dtype=np.float32)})
    writer.node(mesh=mesh, translation=[0, 0, 5], extensions={"EXT_mesh_gpu_instancing": instancing})
    writer.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    found = one(writer, path)
    x, y, z = TETRAHEDRON.T
    wanted = [np.stack([x + 1, y, z + 5], axis=1), np.stack([-y, 3 * x + 2, 5 - z], axis=1)]
    np.testing.assert_allclose(found.vertices, np.concatenate(wanted), atol=1e-6)
    assert volume(found) == pytest.approx(1 / 6 + 3 / 6)
    assert len(found.visual.vertex_colors) == 8


@pytest.mark.parametrize(
    ("mode", "corners", "wanted"),
    [
        (5, [0, 1, 2, 3], [[0, 1, 2], [2, 1, 3]]),
        (5, [0, 1, 2, 2, 3, 3, 1, 0], [[0, 1, 2], [3, 0, 1]]),
        (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (4, None, [[0, 1, 2]]),
    ],
)
def test_strips_fans_and_corners_in_their_order_are_triangles(path, mode, corners, wanted):
    writer = GltfWriter()
    positions = TETRAHEDRON if corners else TETRAHEDRON[:3]
    writer.node(
        mesh=writer.mesh(positions, None if corners is None else np.array(corners, np.uint8), mode=mode)
    )
    found = one(writer, path)
    rolled = [[int(v) for v in np.roll(row, -np.argmin(row))] for row in found.triangles]
    assert rolled == [[int(v) for v in np.roll(row, -np.argmin(row))] for row in wanted]


def test_what_a_file_has_besides_and_what_was_made_of_it_is_noted(path):
    writer = skinned()
    mesh = writer.json["meshes"][0]
    mesh["primitives"].append({**mesh["primitives"][0], "mode": 1})
    mesh["primitives"][0]["targets"] = [{"POSITION": mesh["primitives"][0]["attributes"]["POSITION"]}]
    writer.add("animations", name="run", channels=[], samplers=[])
    writer.add("animations", channels=[], samplers=[])
    writer.node(False, mesh=0)
    writer.json["extensionsUsed"] = ["KHR_mesh_quantization", "KHR_materials_unlit"]
    assert one(writer, path).notes == (
        "1 primitive with a skin, 2 joints in total: posed by the file's rest pose",
        "1 primitive with morph targets, not applied: their default weights are 0",
        "2 animations (run, 1): not played",
        "1 primitive without triangles (points or lines): skipped",
        "1 node with a mesh outside the default scene or hidden: skipped",
        "extensions: KHR_mesh_quantization (read); KHR_materials_unlit (ignored)",
    )


def test_the_default_scene_is_read_and_names_are_told_apart(path):
    writer = GltfWriter()
    mesh = writer.mesh()
    writer.node(False, mesh=mesh, name="other")
    writer.add("scenes", nodes=[writer.node(False, mesh=mesh, name="crate") for _ in range(3)])
    writer.json["scene"] = 1
    assert [each.name for each in read(writer, path)] == ["crate", "crate 2", "crate 3"]


def texture(writer, content, **image):
    """The number of a texture, its picture in the file."""
    where = {} if "uri" in image else {"bufferView": writer.view(content), "mimeType": "image/png"}
    return writer.add("textures", source=writer.add("images", **where, **image))


def png(color):
    image, content = pytest.importorskip("PIL.Image"), io.BytesIO()
    image.new("RGB", (2, 2), color).save(content, "png")
    return content.getvalue()


def painted(writer, used, uv=None, name="TEXCOORD_0", **attributes):
    uv = TETRAHEDRON[:, :2] if uv is None else uv
    material = writer.add(
        "materials", pbrMetallicRoughness={"baseColorTexture": used, "baseColorFactor": [1, 0.5, 0, 1]}
    )
    writer.node(mesh=writer.mesh(attributes={name: uv, **attributes}, material=material))
    return writer


@pytest.mark.parametrize("where", ["view", "data", "file"])
def test_the_texture_of_the_base_colour_is_read_from_the_file_or_beside_it(tmp_path, where):
    writer, content = GltfWriter(), png((10, 200, 30))
    (tmp_path / "my tex.png").write_bytes(content)
    uri = {"data": "data:image/png;base64," + base64.b64encode(content).decode(), "file": "my%20tex.png"}
    index = texture(writer, content, **({} if where == "view" else {"uri": uri[where]}))
    found = one(painted(writer, {"index": index}), tmp_path / "x.gltf")
    assert found.visual.material.baseColorTexture.getpixel((0, 0)) == (10, 200, 30)
    assert found.visual.material.baseColorFactor.tolist() == [255, 128, 0, 255]
    assert found.notes == ()


def test_without_pillow_the_shape_is_read_and_the_extra_is_named(path, monkeypatch):
    writer = GltfWriter()
    painted(writer, {"index": texture(writer, b"never looked at")})
    monkeypatch.setitem(sys.modules, "PIL", None)
    found = one(writer, path)
    np.testing.assert_array_equal(found.vertices, TETRAHEDRON)
    assert found.notes == ("texture images are not read without pillow: run pip install 'taichi-soft[film]'",)


@pytest.mark.parametrize(
    ("content", "image", "text"),
    [
        (b"no picture", {}, "texture image 0 is not read: its format is unknown to pillow"),
        (None, {"uri": "my%20tex.png"}, "texture 'my%20tex.png' is not read .*does not exist"),
        (-1, {}, "texture image 0 is not read"),
    ],
)
def test_a_texture_that_cannot_be_read_is_noted(tmp_path, content, image, text):
    writer = GltfWriter()
    content = png((1, 2, 3))[:-30] if content == -1 else content
    painted(writer, {"index": texture(writer, content, **image)})
    (note,) = one(writer, tmp_path / "x.gltf").notes
    assert re.match(text, note), note


def test_a_texture_of_another_format_is_taken_where_the_extension_names_it(path):
    image, content = pytest.importorskip("PIL.Image"), io.BytesIO()
    image.new("RGB", (2, 2), (9, 9, 9)).save(content, "webp", lossless=True)
    writer = GltfWriter()
    number = writer.add("images", bufferView=writer.view(content.getvalue()), mimeType="image/webp")
    index = writer.add("textures", extensions={"EXT_texture_webp": {"source": number}})
    writer.json["extensionsRequired"] = ["EXT_texture_webp"]
    found = one(painted(writer, {"index": index}), path)
    assert found.visual.material.baseColorTexture.convert("RGB").getpixel((0, 0)) == (9, 9, 9)


def test_texture_coordinates_are_those_that_the_texture_uses_with_v_upwards(path):
    """The example of KHR_texture_transform: all coordinates lie in the lower left quarter of the image."""
    change = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5], "texCoord": 1}
    writer = GltfWriter()
    used = {"index": texture(writer, png((0, 0, 0))), "extensions": {"KHR_texture_transform": change}}
    square = np.array([[0, 0], [255, 0], [0, 255], [255, 255]], np.uint8)
    uv = writer.accessor(square, normalized=True)
    other = np.full((4, 2), 7, np.float32)
    found = one(painted(writer, used, uv, "TEXCOORD_1", TEXCOORD_0=other), path)
    np.testing.assert_allclose(found.visual.uv, [[0, 0], [0, 0.5], [0.5, 0], [0.5, 0.5]], atol=1e-12)


@pytest.mark.parametrize(
    ("rows", "normalized"),
    [(np.array([[1, 0.5, 0]] * 4, "f4"), False), (np.array([[65535, 32768, 0, 0]] * 4, "u2"), True)],
)
def test_colours_of_vertices_are_shares_of_255(path, rows, normalized):
    writer = GltfWriter()
    writer.node(mesh=writer.mesh(attributes={"COLOR_0": writer.accessor(rows, normalized=normalized)}))
    found = one(writer, path)
    assert found.visual.kind == "vertex"
    assert found.visual.vertex_colors.tolist() == [[255, 128, 0, 0 if normalized else 255]] * 4


@pytest.mark.parametrize("is_quantised", [False, True])
def test_draco_is_decoded_by_its_package_and_named_with_its_extra_without(path, monkeypatch, is_quantised):
    draco = pytest.importorskip("DracoPy")
    scale = 32767 if is_quantised else 1
    packed = draco.encode(TETRAHEDRON * np.float64(scale), FACES.astype(np.uint32), quantization_bits=16)
    writer = GltfWriter()
    kind = {"componentType": 5122, "normalized": True} if is_quantised else {"componentType": 5126}
    position = writer.add("accessors", type="VEC3", count=4, **kind)
    told = {"bufferView": writer.view(packed), "attributes": {"POSITION": 0}}
    mesh = writer.mesh(position, None, extensions={"KHR_draco_mesh_compression": told})
    writer.node(mesh=mesh, scale=[1, 2, 1])
    writer.json["extensionsRequired"] = writer.json["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    found = one(writer, path)
    assert volume(found) == pytest.approx(2 / 6, rel=1e-4)
    assert found.notes == ("extensions: KHR_draco_mesh_compression (read)",)
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    message = refusal(path)
    assert "KHR_draco_mesh_compression" in message
    assert "pip install 'taichi-soft[io]'" in message
    assert "npx @gltf-transform/cli copy x.glb x-plain.glb" in message


def meshopt_view(writer):
    """Add a view as compressors write it: the buffer that the view names has no bytes."""
    writer.json["buffers"] = [
        {"byteLength": len(writer.blob)},
        {"byteLength": 48, "extensions": {"EXT_meshopt_compression": {"fallback": True}}},
    ]
    writer.json["bufferViews"][0]["buffer"] = 1


@pytest.mark.parametrize("is_required", [True, False])
def test_meshopt_is_refused_with_the_command_that_removes_it(path, is_required):
    writer = simple()
    meshopt_view(writer)
    if is_required:
        writer.json["extensionsRequired"] = ["EXT_meshopt_compression"]
    message = refusal(writer.write(path))
    assert "EXT_meshopt_compression" in message
    assert "npx @gltf-transform/cli copy x.glb x-plain.glb" in message


def test_required_extensions_are_read_known_to_change_no_shape_or_refused_by_name(path):
    writer = simple()
    writer.json["extensionsRequired"] = ["KHR_materials_unlit", "KHR_texture_transform"]
    assert len(read(writer, path)) == 1
    writer.json["extensionsRequired"] += ["ACME_gizmo"]
    assert "requires the extension ACME_gizmo" in refusal(writer.write(path))


def changed(change):
    writer = simple()
    change(SimpleNamespace(**writer.json))
    return writer


DAMAGED = {
    "cycle": (lambda f: f.nodes[0].update(children=[0]), "cycle|two parents"),
    "two parents": (
        lambda f: f.nodes.extend([{"children": [0]}, {"children": [0]}]),
        "node 0 has two parents",
    ),
    "no such mesh": (lambda f: f.nodes[0].update(mesh=7), r"meshes\[7\] .*has 1"),
    "index too large": (
        lambda f: f.meshes[0]["primitives"][0].update(indices=0),
        "accessor 0 has the type 'VEC3'",
    ),
    "half a triangle": (lambda f: f.accessors[1].update(count=11), "11 triangle corners, .*multiple of 3"),
    "count beyond the buffer": (
        lambda f: f.accessors[0].update(count=10**12),
        "its buffer view has 48 bytes",
    ),
    "count of nothing": (
        lambda f: (f.accessors[0].pop("bufferView"), f.accessors[0].update(count=10**12)),
        "rows without data",
    ),
    "sparse beyond the buffer": (
        lambda f: f.accessors[0].update(
            sparse={
                "count": 10**12,
                "indices": {"bufferView": 1, "componentType": 5121},
                "values": {"bufferView": 0},
            }
        ),
        "sparse part of accessor 0",
    ),
    "view beyond the buffer": (lambda f: f.bufferViews[0].update(byteLength=10**12), "buffer view 0 ends"),
    "stride": (lambda f: f.bufferViews[0].update(byteStride=4), "12 bytes, 4 bytes apart"),
    "negative offset": (
        lambda f: f.bufferViews[0].update(byteOffset=-4),
        "byteOffset of buffer view 0 is -4",
    ),
    "infinite": (lambda f: f.nodes[0].update(scale=[float("inf"), 1, 1]), "scale of node 0"),
    "overflow": (lambda f: f.nodes[0].update(scale=[1e200, 1e200, 1e200]), "coordinates must lie"),
    "no type": (lambda f: f.accessors[0].pop("type"), "has the type None"),
    "version": (lambda f: f.asset.update(version="1.0"), "npx gltf-pipeline"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_are_refused_in_a_line_before_memory_is_taken(path, name):
    change, text = DAMAGED[name]
    changed(change).write(path)
    refusal(path)  # what is imported at the first call
    tracemalloc.start()
    message = refusal(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert re.search(text, message), message
    assert peak < 1_000_000


@pytest.mark.parametrize("name", ["NORMAL", "TEXCOORD_0", "COLOR_0", "JOINTS_0", "WEIGHTS_0"])
def test_attributes_with_other_rows_than_the_vertices_are_refused(path, name):
    writer, columns = GltfWriter(), {"NORMAL": 3, "TEXCOORD_0": 2}.get(name, 4)
    attributes = {"JOINTS_0": np.zeros((4, 4), np.uint8), "WEIGHTS_0": np.ones((4, 4), np.float32)}
    rows = np.zeros((3, columns), np.uint8 if name == "JOINTS_0" else np.float32)
    mesh = writer.mesh(attributes={**attributes, name: rows})
    writer.node(mesh=mesh, skin=writer.add("skins", joints=[0]))
    assert f"3 rows of {name} for 4 vertices" in refusal(writer.write(path))


def test_an_index_beyond_the_vertices_is_refused(path):
    writer = GltfWriter()
    writer.node(mesh=writer.mesh(triangles=np.array([[0, 1, 2], [0, 1, 9]], np.uint8)))
    assert "refers to vertex 9 of 4" in refusal(writer.write(path))


def test_a_small_file_that_asks_for_many_vertices_is_refused_before_memory_is_taken(path):
    writer = GltfWriter()
    zeros = writer.add("accessors", componentType=5126, type="VEC3", count=10_000)
    places = writer.add("accessors", componentType=5126, type="VEC3", count=10_000)
    mesh = writer.mesh(zeros, np.zeros(3, np.uint8))
    writer.node(mesh=mesh, extensions={"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}})
    writer.write(path)
    tracemalloc.start()
    message = refusal(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "more than 10,000,000 vertices" in message
    assert peak < 30_000_000


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_file_cut_short_is_refused_wherever_it_ends(tmp_path, suffix):
    whole = skinned().write(tmp_path / f"x{suffix}").read_bytes()
    for end in [*range(0, len(whole), 9), *range(len(whole) - 20, len(whole))]:
        (tmp_path / f"x{suffix}").write_bytes(whole[:end])
        refusal(tmp_path / f"x{suffix}")
    text = whole.decode("utf-8", errors="replace").encode()
    if suffix == ".glb":
        (tmp_path / "x.glb").write_bytes(text)
        assert "as text. Copy the original as a binary file" in refusal(tmp_path / "x.glb")
    (tmp_path / "x.gltf").write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    assert "git lfs pull" in refusal(tmp_path / "x.gltf")


@pytest.mark.parametrize(
    ("name", "uri", "text"),
    [
        ("x.gltf", "gone.bin", "'gone.bin', which does not exist"),
        ("x.gltf", "https://example.org/x.bin", "put that file next to it"),
        ("x.gltf", "/etc/hostname", "put that file next to it"),
        ("x.gltf", "C:\\x.bin", "put that file next to it"),
        ("x.gltf", "data:application/octet-stream;base64,AAA", "damaged|cut short"),
        ("x.gltf", "a\0b", "does not exist"),
        ("x.gltf", ".", "does not exist"),
        ("x.glb", "../x.bin", "outside its folder"),
        ("x.glb", "%2e%2e/x.bin", "outside its folder"),
    ],
)
def test_buffers_elsewhere_are_refused_by_name(tmp_path, name, uri, text):
    writer, folder = simple(), tmp_path / "a"
    folder.mkdir()
    (tmp_path / "x.bin").write_bytes(writer.blob)
    writer.json["buffers"] = [{"byteLength": len(writer.blob), "uri": uri}]
    assert re.search(text, refusal(writer.write(folder / name)))


ODD = (None, -1, 0, 3, 10**12, 1e300, float("nan"), True, "", "x", [], [0], {}, {"x": 1})


def leaves(value, place=()):
    yield place
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, below in items:
        yield from leaves(below, (*place, key))


@pytest.mark.filterwarnings("error")
def test_whatever_is_wrong_in_the_json_is_refused_or_read_but_nothing_else(path):
    writer = skinned()
    painted(
        writer, {"index": texture(writer, b"none"), "extensions": {"KHR_texture_transform": {"rotation": 1}}}
    )
    writer.json["meshes"][1].update(weights=[1])
    writer.json["meshes"][1]["primitives"][0]["targets"] = [{"POSITION": 0}]
    writer.json["nodes"][-1]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}}
    writer.json["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": 1, "componentType": 5121},
        "values": {"bufferView": 0},
    }
    writer.json.update(animations=[{"name": "run"}], extensionsUsed=["A"], extensionsRequired=[])
    whole, random = writer.json, np.random.default_rng(0)
    places = [place for place in leaves(whole) if place]
    read_count = 0
    for place in places:
        writer.json = copy.deepcopy(whole)
        target = writer.json
        for key in place[:-1]:
            target = target[key]
        target[place[-1]] = ODD[random.integers(len(ODD))]
        with contextlib.suppress(MeshError):
            read_count += len(read(writer, path)) > 0
    assert 0 < read_count < len(places)
