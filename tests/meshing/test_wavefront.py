"""The .obj reader, compared with a separate reader that treats each corner of each face by itself."""

import re

import numpy as np
import pytest
from PIL import Image

from taichi_soft import MeshError
from taichi_soft.doctor.triangle_facts import facts_of
from taichi_soft.meshing.surfaces import read_surfaces

pytestmark = pytest.mark.numpy

FORMS = ["{0}", "{0}/{1}", "{0}//{2}", "{0}/{1}/{2}"]


def polygons(rng, forms, count=60):
    """Text of convex polygons in random planes, with statements in turn, so that indices from the end differ.

    Vertices, texture coordinates and normals have random indices of random senses.
    """
    lines, sizes = [], [0, 0, 0]
    for number in range(count):
        corners = int(rng.integers(3, 8))
        plane, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        angles = np.sort(rng.random(corners)) * 0.2 + np.arange(corners) / corners * 2 * np.pi
        points = rng.normal(size=3) * 5 + np.stack([np.cos(angles), np.sin(angles)], axis=1) @ plane[:2]
        normal = np.cross(plane[0], plane[1])
        lines += [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in points]
        lines += [f"vt {u:.6f} {v:.6f}" for u, v in rng.random((4, 2))]
        lines += ["vn {:.6f} {:.6f} {:.6f}".format(*(normal + 0.2 * rng.normal(size=3))) for _ in range(2)]
        base = list(sizes)
        sizes = [sizes[0] + corners, sizes[1] + 4, sizes[2] + 2]
        if number % 5 == 0:
            lines.append(f"usemtl m{rng.integers(3)}\ng part{number}\ns {number % 2}")
        form = forms[number % len(forms)]
        words = []
        for corner in range(corners):
            at = [base[0] + corner, base[1] + rng.integers(4), base[2] + rng.integers(2)]
            is_back = rng.random() < 0.5
            words.append(
                form.format(*(a - size if is_back else a + 1 for a, size in zip(at, sizes, strict=True)))
            )
        lines.append("f " + " ".join(words))
    return "\n".join(lines) + "\n"


def faces_of(text):
    """Material and corners (position, texture coordinate or None, normal or None) of each face."""
    tables, faces, material = {"v": [], "vt": [], "vn": []}, [], ""
    for line in text.splitlines():
        head, *words = line.split() or [""]
        if head in tables:
            tables[head].append([float(word) for word in words])
        elif head == "usemtl":
            material = words[0]
        elif head == "f":
            corners = []
            for word in words:
                indices = [int(part) if part else None for part in word.split("/")] + [None, None]
                corners.append(
                    [
                        None if i is None else rows[i - 1 if i > 0 else i]
                        for i, rows in zip(indices[:3], tables.values(), strict=True)
                    ]
                )
            faces.append((material, corners))
    return faces


def polygon_area(points):
    """Return the area of a plane polygon: half the sum of the cross products along its edges."""
    points = np.asarray(points)
    return 0.5 * np.linalg.norm(np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0))


@pytest.mark.parametrize("forms", [[form] for form in FORMS] + [FORMS], ids=[*FORMS, "mixed"])
def test_each_corner_has_what_its_face_says(tmp_path, forms):
    text = polygons(np.random.default_rng(len(forms[0]) + len(forms)), forms)
    (tmp_path / "x.obj").write_text(text)
    surfaces = read_surfaces(tmp_path / "x.obj", up="z")
    materials = list(dict.fromkeys(material for material, _ in faces_of(text)))
    assert [each.name for each in surfaces] == materials
    assert not any(each.notes for each in surfaces)
    for surface in surfaces:
        triangles = iter(surface.triangles)
        for _, corners in (face for face in faces_of(text) if face[0] == surface.name):
            its = np.array([next(triangles) for _ in range(len(corners) - 2)])
            areas = [polygon_area(surface.vertices[triangle]) for triangle in its]
            assert sum(areas) == pytest.approx(polygon_area([point for point, _, _ in corners]), rel=1e-6)
            for vertex in its.ravel():
                place = surface.vertices[vertex]
                (found,) = (corner for corner in corners if np.abs(corner[0] - place).max() < 1e-6)
                if found[1] is not None:
                    np.testing.assert_allclose(surface.visual.uv[vertex], found[1], atol=1e-9)
                if found[2] is not None:
                    unit = found[2] / np.linalg.norm(found[2])
                    np.testing.assert_allclose(surface.normals[vertex], unit, atol=1e-9)
        assert next(triangles, None) is None


CRATE = """
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 4/1 3/2 2/3 1/4
f 5/1 6/2 7/3 8/4
f 1/1 2/2 6/3 5/4
f 2/1 3/2 7/3 6/4
f 3/1 4/2 8/3 7/4
f 4/1 1/2 5/3 8/4
"""


def written(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_vertices_keep_their_numbers_and_copies_at_seams_come_behind(tmp_path):
    """A game may rely on this order for a mapping to its file.

    Equal texture coordinates of two indices count as one.
    """
    lone = CRATE.replace("vt 0 0", "v 9 9 9\nvt 0 0", 1)  # of no face
    (found,) = read_surfaces(written(tmp_path / "crate.obj", lone), up="z")
    own = np.array(
        [[float(word) for word in line.split()[1:]] for line in lone.splitlines() if line[:2] == "v "]
    )
    np.testing.assert_array_equal(found.vertices[:9], own)
    copies = [int(np.abs(own - row).sum(axis=1).argmin()) for row in found.vertices[9:]]
    assert copies == sorted(copies)
    seen = {(tuple(point), tuple(uv)) for _, face in faces_of(lone) for point, uv, _ in face}
    assert len(found.vertices) == len(seen) + 1
    again = CRATE.replace("vt 0 1", "vt 0 1\nvt 0 0").replace("f 5/1", "f 5/5")
    (same,) = read_surfaces(written(tmp_path / "again.obj", again), up="z")
    assert len(same.vertices) == len(seen)
    bare = "\n".join(
        " ".join(word.split("/")[0] for word in line.split())
        for line in CRATE.splitlines()
        if "vt" not in line
    )
    (bare_one,) = read_surfaces(written(tmp_path / "bare.obj", bare), up="z")
    np.testing.assert_array_equal(bare_one.vertices, own[:8])
    assert facts_of((same,)).open_edges == facts_of((bare_one,)).open_edges == 0


def test_normals_that_are_not_said_are_smooth_across_seams(tmp_path):
    (found,) = read_surfaces(written(tmp_path / "crate.obj", CRATE), up="z")
    np.testing.assert_allclose(found.normals, (found.vertices - 0.5) / np.sqrt(0.75), atol=1e-12)


ODD = {
    "Latin-1": lambda text: "# caf\u00e9\no bo\u00eete\n".encode("latin-1") + text.encode(),
    "UTF-8 with a mark": lambda text: text.encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16, little, no mark": lambda text: text.encode("utf-16-le"),
    "UTF-16, big, no mark": lambda text: text.encode("utf-16-be"),
    "CR": lambda text: text.replace("\n", "\r").encode(),
    "CR LF": lambda text: text.replace("\n", "\r\n").encode(),
    "tabs and leading spaces": lambda text: text.replace(" ", "\t ").replace("\n", "\n \t").encode(),
    "lines that go on": lambda text: text.replace("f 1", "f \\\n 1").replace("v 1", "v \\\r\n1").encode(),
    "comments behind": lambda text: text.replace("\n", " # 1 2 3\n").encode(),
    "no line end": lambda text: text.strip().encode(),
    "other statements": lambda text: ("vp 1 2\ncstype bezier\n" + text + "l 1 2\np 3\nf 1 2\n").encode(),
}


@pytest.mark.parametrize("odd", ODD)
def test_text_is_read_however_it_is_written(tmp_path, odd):
    (wanted,) = read_surfaces(written(tmp_path / "crate.obj", CRATE))
    (found,) = read_surfaces(written(tmp_path / "odd.obj", ODD[odd](CRATE)))
    np.testing.assert_array_equal(found.vertices, wanted.vertices)
    np.testing.assert_array_equal(found.triangles, wanted.triangles)
    np.testing.assert_array_equal(found.visual.uv, wanted.visual.uv)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("f 1 2 9", "face 6 names vertex 8, .*8 vertices.*export it again"),
        ("f 1 2 -9", "face 6.*vertex before"),
        ("f 1 2 0", "whole numbers from 1"),
        ("f 1 2 1.5", "whole numbers from 1"),
        ("v 1 2", "vertex 8 is '1 2': .*3 numbers"),
        ("v 1,5 2 3", "decimal point"),
        ("v 1 2 nan", "finite"),
    ],
)
def test_what_is_no_face_or_vertex_is_refused_with_its_words(tmp_path, line, text):
    with pytest.raises(MeshError, match=f"^x.obj: .*{text}"):
        read_surfaces(written(tmp_path / "x.obj", f"{CRATE}{line}\n"))


def test_what_a_corner_lacks_is_made_up_and_said(tmp_path):
    text = CRATE.replace("f 4/1 ", "f 4/7 ") + "vn 0 0 1.#IND\nf 1//1 3//1 2//8\n"
    (found,) = read_surfaces(written(tmp_path / "x.obj", text), up="z")
    assert np.isfinite(found.normals).all()
    assert np.isfinite(found.visual.uv).all()
    notes = " ".join(found.notes)
    assert re.search("2 corners .*texture coordinates .*1 corner .*normals", notes)


LIBRARY = """
newmtl wood \u00e9
  Kd 0.8 0.8 0.8
\tmap_Kd -s 2 2 1 -o 0.5 -bm 0.3 -clamp on pictures\\my wood.png
newmtl red
Kd 1 0 0
d 0.5
newmtl lost
map_Kd gone.png
newmtl ink
map_Kd INK.png
newmtl bare
"""


def test_materials_have_their_colour_and_texture_or_a_note(tmp_path):
    """Textures lie beside their library or beside the .obj file, in the case that Windows does not mind."""
    looks, crates = tmp_path / "looks", tmp_path / "crates"
    for folder in (looks / "pictures", crates):
        folder.mkdir(parents=True)
    Image.new("RGB", (4, 4), (10, 200, 30)).save(looks / "pictures" / "my wood.png")
    Image.new("RGB", (4, 4), (9, 8, 7)).save(crates / "Ink.PNG")
    (looks / "my looks.mtl").write_bytes(LIBRARY.encode("latin-1"))
    used = ["wood \u00e9", "nowhere", "bare", "lost", "ink", "red"]
    faces = [line for line in CRATE.splitlines() if line.startswith("f ")]
    lines = ["mtllib ../looks/my looks.mtl", *(line for line in CRATE.splitlines() if line not in faces)]
    lines += [f"usemtl {name}\n{face}" for name, face in zip(used, faces, strict=True)]
    surfaces = read_surfaces(written(crates / "x.obj", "\n".join(lines).encode("latin-1")))
    assert [each.name for each in surfaces] == used
    material = {each.name: each.visual.material for each in surfaces}
    assert material["wood \u00e9"].baseColorTexture.getpixel((0, 0)) == (10, 200, 30)
    assert material["wood \u00e9"].baseColorFactor is None  # as Blender has it: in place of the colour
    assert material["ink"].baseColorTexture.getpixel((0, 0)) == (9, 8, 7)
    assert material["red"].baseColorFactor.tolist() == [255, 0, 0, 128]
    assert material["bare"].baseColorFactor is None
    notes = " ".join(surfaces[0].notes)
    assert "the texture gone.png is not read: there is no such file beside it" in notes
    assert "no material nowhere" in notes


def test_a_library_that_is_missing_is_said(tmp_path):
    (found,) = read_surfaces(written(tmp_path / "x.obj", "mtllib other.mtl\n" + CRATE))
    assert "no file 'other.mtl' beside it" in " ".join(found.notes)


def test_a_file_reads_nothing_from_outside_of_the_folder_above_its_own(tmp_path):
    """Visitors of the live page can send such files."""
    secret = tmp_path / "secret.png"
    Image.new("RGB", (2, 2)).save(secret)
    folder = tmp_path / "uploads" / "first"
    folder.mkdir(parents=True)
    for name in ("../../secret.png", str(secret), "..\\..\\secret.png"):
        text = (
            f"mtllib x.obj\n{CRATE.replace('f 4/1', 'usemtl a' + chr(10) + 'f 4/1')}newmtl a\nmap_Kd {name}\n"
        )
        (found,) = read_surfaces(written(folder / "x.obj", text))
        assert found.visual.material.baseColorTexture is None
        assert "is not read: there is no such file beside it" in " ".join(found.notes)


def test_colours_of_vertices_go_with_their_copies(tmp_path):
    rng = np.random.default_rng(3)
    shades = rng.integers(0, 256, (8, 3))
    rows = iter(shades / 255)
    text = "\n".join(
        f"{line} {' '.join(f'{part:.6f}' for part in next(rows))}" if line.startswith("v ") else line
        for line in CRATE.splitlines()
    )
    (found,) = read_surfaces(written(tmp_path / "x.obj", text), up="z")
    own = np.array([[x, y, z] for x, y, z in found.vertices[:8]])
    at = [int(np.abs(own - row).sum(axis=1).argmin()) for row in found.vertices]
    np.testing.assert_array_equal(found.visual.vertex_colors[:, :3], shades[at])
