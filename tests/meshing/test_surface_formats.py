"""Readers of .ply, .stl and .off, compared with separate writers, and with odd or damaged files."""

import struct

import numpy as np
import pytest
from PIL import Image

from taichi_soft import MeshError
from taichi_soft.meshing.surfaces import read_surfaces

pytestmark = pytest.mark.numpy

RNG = np.random.default_rng(5)
POINTS = RNG.normal(size=(9, 3)).round(3).astype(np.float32)
NORMALS = np.tile(np.float32([0.6, 0.0, 0.8]), (9, 1))
COLORS = RNG.integers(0, 256, (9, 4))
PLACES = RNG.random((9, 2)).round(3).astype(np.float32)
FACES = [[0, 1, 2], [2, 3, 4, 5], [6, 7, 8], [8, 0, 3]]
UNIFORM = [[0, 1, 2], [2, 3, 4], [6, 7, 8], [8, 0, 3]]

TYPES = {"char": "b", "uchar": "B", "ushort": "H", "int": "i", "float": "f", "double": "d"}


def ply(kind, elements, line_end="\n", comments=()):
    """A file of elements: name -> (columns of (name, type or (type of length, type)), rows of values)."""
    lines = ["ply", f"format {kind} 1.0", *(f"comment {each}" for each in comments)]
    for name, (columns, rows) in elements.items():
        lines.append(f"element {name} {len(rows)}")
        for column, its in columns:
            lines.append(f"property {its if isinstance(its, str) else 'list ' + ' '.join(its)} {column}")
    head = line_end.join([*lines, "end_header", ""]).encode()
    body = []
    for columns, rows in elements.values():
        for row in rows:
            values = []
            for (_, its), value in zip(columns, row, strict=True):
                if isinstance(its, str):
                    values.append((its, value))
                else:
                    values += [(its[0], len(value)), *((its[1], each) for each in value)]
            if kind == "ascii":
                body.append(" ".join(str(value) for _, value in values).encode() + line_end.encode())
            else:
                order = "<" if "little" in kind else ">"
                body += [struct.pack(order + TYPES[its], value) for its, value in values]
    return head + b"".join(body)


def vertices(*more):
    """Columns and rows of vertices, with more columns of ((name, type), values)."""
    columns = [(axis, "float") for axis in "xyz"] + [each[0] for each in more]
    rows = [[*point, *(each[1][i].item() for each in more)] for i, point in enumerate(POINTS.tolist())]
    return columns, rows


def faces(rows, length="uchar", index="int", name="vertex_indices"):
    return [(name, (length, index))], [[row] for row in rows]


def fans(rows):
    return [[row[0], row[k], row[k + 1]] for row in rows for k in range(1, len(row) - 1)]


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("rows", [FACES, UNIFORM], ids=["mixed", "uniform"])
def test_a_ply_file_has_what_its_header_says(tmp_path, kind, line_end, rows):
    more = [((name, "float"), NORMALS[:, k]) for k, name in enumerate(("nx", "ny", "nz"))]
    more += [((name, "float"), PLACES[:, k]) for k, name in enumerate("st")]
    more += [(("quality", "double"), POINTS[:, 0].astype(float))]
    elements = {
        "camera": ([("view", "float")], [[1.5]]),
        "vertex": vertices(*more),
        "face": faces(rows, name="vertex_index"),
        "behind": ([("a", "ushort")], [[1]]),
    }
    (tmp_path / "x.ply").write_bytes(ply(kind, elements, line_end))
    (found,) = read_surfaces(tmp_path / "x.ply")
    np.testing.assert_array_equal(found.vertices.astype(np.float32), POINTS)
    np.testing.assert_array_equal(found.triangles, fans(rows))
    np.testing.assert_allclose(found.visual.uv, PLACES, atol=1e-7)
    assert found.visual.material.baseColorTexture is None
    up = np.einsum(
        "tx,x->t",
        np.cross(*(POINTS[fans(rows)][:, [1, 2]] - POINTS[fans(rows)][:, :1]).swapaxes(0, 1)),
        NORMALS[0],
    )
    agrees = np.zeros(9, bool)  # all other normals are computed again
    np.logical_or.at(agrees, np.array(fans(rows)).ravel(), np.repeat(up > 0, 3))
    np.testing.assert_allclose(found.normals[agrees], NORMALS[agrees], atol=1e-7)


@pytest.mark.parametrize("type_of", ["uchar", "ushort", "float"])
def test_colours_of_a_ply_file_have_the_range_of_their_type(tmp_path, type_of):
    factor = {"uchar": 1, "ushort": 257, "float": 1 / 255}[type_of]
    shades = (COLORS * factor).astype({"uchar": "u1", "ushort": "u2", "float": "f4"}[type_of])
    named = [((name, type_of), shades[:, k]) for k, name in enumerate(("red", "green", "blue"))]
    content = ply("binary_little_endian", {"vertex": vertices(*named), "face": faces(FACES)})
    (tmp_path / "x.ply").write_bytes(content)
    (found,) = read_surfaces(tmp_path / "x.ply")
    np.testing.assert_array_equal(found.visual.vertex_colors[:, :3], COLORS[:, :3])


def test_faces_of_a_ply_file_have_their_own_colours_and_places_on_a_texture(tmp_path):
    Image.fromarray(np.full((2, 2, 3), (1, 2, 3), np.uint8)).save(tmp_path / "look.png")
    places = [RNG.random((len(row), 2)).round(3).astype(np.float32) for row in FACES]
    columns = [("vertex_indices", ("uchar", "int")), ("texcoord", ("uchar", "float"))]
    rows = [[row, place.ravel().tolist()] for row, place in zip(FACES, places, strict=True)]
    elements = {"vertex": vertices(), "face": (columns, rows)}
    (tmp_path / "x.ply").write_bytes(ply("binary_little_endian", elements, comments=["TextureFile look.png"]))
    (found,) = read_surfaces(tmp_path / "x.ply")
    np.testing.assert_array_equal(found.vertices[:9].astype(np.float32), POINTS)
    assert found.visual.material.baseColorTexture.getpixel((0, 0)) == (1, 2, 3)
    at = iter(found.triangles)
    for row, place in zip(FACES, places, strict=True):
        for k in range(1, len(row) - 1):
            np.testing.assert_allclose(found.visual.uv[next(at)], place[[0, k, k + 1]], atol=1e-7)
    columns = [("vertex_indices", ("uchar", "int")), *((name, "uchar") for name in ("red", "green", "blue"))]
    rows = [[row, *COLORS[k, :3].tolist()] for k, row in enumerate(FACES)]
    (tmp_path / "y.ply").write_bytes(ply("ascii", {"vertex": vertices(), "face": (columns, rows)}))
    (found,) = read_surfaces(tmp_path / "y.ply")
    shades = found.visual.vertex_colors[found.triangles][:, :, :3]
    np.testing.assert_array_equal(shades[:, 0], COLORS[[0, 1, 1, 2, 3], :3])
    np.testing.assert_array_equal(shades, np.repeat(shades[:, :1], 3, axis=1))


def test_strips_of_a_ply_file_are_unwound(tmp_path):
    """A row of squares in one strip has one orientation, and a second strip starts again."""
    points = [[x, y, 0] for x in range(5) for y in (0, 1)]
    columns = [(axis, "float") for axis in "xyz"]
    strip = [0, 1, 2, 3, 4, 5, -1, 6, 7, 8, 9]
    elements = {"vertex": (columns, points), "tristrips": faces([strip], length="int")}
    (tmp_path / "x.ply").write_bytes(ply("binary_big_endian", elements))
    (found,) = read_surfaces(tmp_path / "x.ply")
    a, b, c = np.moveaxis(found.vertices[found.triangles], 1, 0)
    np.testing.assert_allclose(np.cross(b - a, c - a), [[0, 0, -1]] * 6)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_a_ply_file_that_is_cut_short_or_huge_is_refused(tmp_path, kind):
    content = ply(kind, {"vertex": vertices(), "face": faces(FACES)})
    head = content.index(b"end_header")
    for damaged in (
        content[:-2] if kind != "ascii" else content[:-6],
        content[: head + 40],
        content[:head],
        content.replace(b"element vertex 9", b"element vertex 999999999999"),
        content.replace(b"element face 4", b"element face 4000000000"),
        content.replace(b"property float y", b"property real y"),
        content.replace(b"element vertex 9\n", b""),
        content.replace(b"property float z", b"property float zz"),
    ):
        (tmp_path / "x.ply").write_bytes(damaged)
        with pytest.raises(MeshError, match=r"^x\.ply: "):
            read_surfaces(tmp_path / "x.ply")


def binary_stl(corners, words, header=b"made by a test"):
    rows = [struct.pack("<12fH", 0, 0, 0, *corners[k].ravel(), words[k]) for k in range(len(corners))]
    return header.ljust(80) + struct.pack("<I", len(corners)) + b"".join(rows)


def test_a_binary_stl_file_has_the_colours_of_two_programs(tmp_path):
    corners = POINTS[np.array(fans(FACES))]
    shades = RNG.integers(0, 32, (5, 3))
    red, green, blue = shades.T
    viscam = (1 << 15 | red << 10 | green << 5 | blue).tolist()
    (tmp_path / "x.stl").write_bytes(binary_stl(corners, viscam))
    magics = (blue << 10 | green << 5 | red).tolist()
    magics[2] = 1 << 15
    header = b"solid but binary COLOR=" + bytes([10, 20, 30, 255])
    (tmp_path / "y.stl").write_bytes(binary_stl(corners, magics, header))
    (tmp_path / "z.stl").write_bytes(binary_stl(corners, [0] * 5))
    wanted = np.round(shades * 255 / 31)
    for name in "xy":
        (found,) = read_surfaces(tmp_path / f"{name}.stl")
        np.testing.assert_array_equal(found.vertices.astype(np.float32), corners.reshape(-1, 3))
        np.testing.assert_array_equal(found.triangles, np.arange(15).reshape(5, 3))
        if name == "y":
            wanted[2] = (10, 20, 30)
        np.testing.assert_array_equal(found.visual.vertex_colors[:, :3], np.repeat(wanted, 3, axis=0))
    (plain,) = read_surfaces(tmp_path / "z.stl")
    assert plain.visual is None
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).astype(float)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    np.testing.assert_allclose(plain.normals, np.repeat(across, 3, axis=0), atol=1e-5)
    (tmp_path / "cut.stl").write_bytes(binary_stl(corners, [0] * 5)[:-10])
    with pytest.raises(MeshError, match=r"cut short: .*5 triangles .*has 4"):
        read_surfaces(tmp_path / "cut.stl")


def text_stl(name, corners):
    loops = ("".join(f"vertex {x} {y} {z}\n" for x, y, z in triangle) for triangle in corners.tolist())
    middle = "".join(f"facet normal 0 0 0\n  outer loop\n{loop} endloop\n endfacet\n" for loop in loops)
    return f"solid {name}\n{middle}endsolid {name}\n"


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-16"])
def test_each_solid_of_a_text_stl_file_is_a_surface(tmp_path, line_end, encoding):
    corners = POINTS[np.array(fans(FACES))]
    text = text_stl("d\u00e9 vertex 1 2 3", corners[:2]) + text_stl("", corners[2:]).upper()
    (tmp_path / "x.stl").write_bytes(text.replace("\n", line_end).encode(encoding))
    first, second = read_surfaces(tmp_path / "x.stl")
    assert (first.name, second.name) == ("d\u00e9 vertex 1 2 3", "x.stl")
    np.testing.assert_array_equal(first.vertices.astype(np.float32), corners[:2].reshape(-1, 3))
    np.testing.assert_array_equal(second.vertices.astype(np.float32), corners[2:].reshape(-1, 3))


def off(head, rows, faces, line_end="\n"):
    lines = [head, "# a comment", "", f"{len(rows)} {len(faces)} 0"]
    lines += [" ".join(map(str, row)) for row in rows] + [" ".join(map(str, row)) for row in faces]
    return line_end.join(lines).encode()


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_an_off_file_has_the_colours_of_vertices_and_of_faces(tmp_path, line_end):
    shades = COLORS[:, :3]
    plain = POINTS.tolist()
    own = [[len(row), *row] for row in FACES]
    files = {
        "COFF": [[*p, *c] for p, c in zip(plain, COLORS.tolist(), strict=True)],
        "OFF": [[*p, *(c / 255)] for p, c in zip(plain, shades, strict=True)],  # as MeshLab once did
        "CNOFF": [[*p, 0.6, 0, 0.8, *c] for p, c in zip(plain, shades.tolist(), strict=True)],
    }
    for head, rows in files.items():
        (tmp_path / "x.off").write_bytes(off(head, rows, own, line_end))
        (found,) = read_surfaces(tmp_path / "x.off")
        np.testing.assert_array_equal(found.vertices.astype(np.float32), POINTS)
        np.testing.assert_array_equal(found.triangles, fans(FACES))
        np.testing.assert_array_equal(found.visual.vertex_colors[:, :3], shades)
    (tmp_path / "uv.off").write_bytes(
        off("STOFF", [[*p, *t] for p, t in zip(plain, PLACES, strict=True)], own)
    )
    (found,) = read_surfaces(tmp_path / "uv.off")
    np.testing.assert_allclose(found.visual.uv, PLACES, atol=1e-7)
    painted = [[*own[0], 255, 0, 0], own[1], [*own[2], 0, 255, 0, 255], [*own[3], 7]]
    (tmp_path / "faces.off").write_bytes(off("OFF", plain, painted))
    (found,) = read_surfaces(tmp_path / "faces.off")
    np.testing.assert_array_equal(found.vertices[:9].astype(np.float32), POINTS)
    shades = found.visual.vertex_colors[found.triangles][:, :, :3]
    white = (255, 255, 255)
    np.testing.assert_array_equal(shades[:, 0], [(255, 0, 0), white, white, (0, 255, 0), white])
    np.testing.assert_array_equal(shades, np.repeat(shades[:, :1], 3, axis=1))


def test_off_files_of_other_programs_are_read_or_refused(tmp_path):
    plain, own = POINTS.tolist(), [[len(row), *row] for row in FACES]
    good = off("OFF", plain, own)
    for content in (
        good.replace(b"OFF\n# a comment\n\n", b"OFF"),  # as in ModelNet: OFF9 4 0
        good.replace(b"OFF\n# a comment\n\n", b"OFF "),
        good.replace(b"3 6 7 8", b"3 6\n7\n8"),
        good + b"\n",
    ):
        (tmp_path / "x.off").write_bytes(content)
        (found,) = read_surfaces(tmp_path / "x.off")
        np.testing.assert_array_equal(found.triangles, fans(FACES))
    for content, text in (
        (good.replace(b"9 4 0", b"999999999999 4 0"), "cut short"),
        (good.replace(b"3 8 0 3", b""), "cut short"),
        (good.replace(b"3 8 0 3", b"3 8 0 9"), "face 3 names vertex 9"),
        (good.replace(b"OFF", b"OFF BINARY"), "binary"),
        (good.replace(b"OFF", b"HELLO"), "does not begin with OFF"),
        (b"", "does not begin with OFF"),
        (b"OFF", "no triangles"),
    ):
        (tmp_path / "x.off").write_bytes(content)
        with pytest.raises(MeshError, match=rf"^x\.off: .*{text}"):
            read_surfaces(tmp_path / "x.off")
