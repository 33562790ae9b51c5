"""Files from other programs: valid files are read, others are refused with a reason and a suggestion."""

import contextlib
import importlib
import io
import re
import struct
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from taichi_soft.core.errors import MeshError, SkippedCellsWarning
from taichi_soft.meshing import TetMesh, load_mesh, save_mesh, sphere

pytestmark = pytest.mark.numpy

meshio = pytest.importorskip("meshio")

BALL = sphere(1.0, 2).translated([0.1, 1 / 3, -1e-7])
POINTS = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]]
TETS = [[0, 1, 2, 3], [1, 2, 3, 4]]
PAIR = SimpleNamespace(vertices=np.array(POINTS), tets=np.array(TETS))
HEXAHEDRON = [[5, 6, 7, 8, 9, 10, 11, 12]]
CUBE = [[x + 3.0, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]

VARIANTS = [
    *[("gmsh", ".msh", {"fmt_version": v, "binary": b}) for v in ("2.2", "4.0", "4.1") for b in (0, 1)],
    *[("vtk", ".vtk", {"fmt_version": v, "binary": b}) for v in ("4.2", "5.1") for b in (0, 1)],
    *[("vtu", ".vtu", {"compression": c, "header_type": "UInt64"}) for c in (None, "zlib", "lzma")],
    ("medit", ".mesh", {}),
]


def write(path, module, options, mesh):
    with contextlib.redirect_stderr(io.StringIO()):
        importlib.import_module(f"meshio.{module}").write(str(path), mesh, **options)


def with_data(mesh, blocks, data):
    values = np.random.default_rng(0).normal(size=(len(mesh.points), 3))
    if "points" in data:
        mesh.point_data = {"a": values[:, 0], "b": values}
    if "cells" in data:
        mesh.cell_data = {"c": [np.arange(len(rows)) / 7 for _, rows in blocks]}
    return mesh


def same(found, wanted):
    return np.array_equal(found.vertices, wanted.vertices) and np.array_equal(found.tets, wanted.tets)


@pytest.mark.parametrize(("module", "suffix", "options"), VARIANTS)
def test_what_meshio_writes_is_read_back_the_same_without_a_warning(tmp_path, module, suffix, options):
    tets, faces = ("tetra", BALL.tets.astype(np.int64)), ("triangle", BALL.surface.astype(np.int64))
    for number, data in enumerate(["", "points", "cells", "points cells"]):
        for blocks in ([tets], [faces, tets]):
            if len(blocks) == 2 and options.get("fmt_version") == "4.1":
                continue  # meshio requires more than cells in this format
            path = tmp_path / f"{number}-{len(blocks)}{suffix}"
            write(path, module, options, with_data(meshio.Mesh(BALL.vertices, blocks), blocks, data))
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                assert same(load_mesh(path), BALL), path


def binary_22(closing=b"\n"):
    """Version 2.2; PyMesh and fTetWild write `$End...` at once behind the data: there `closing` is empty."""
    line_in_data = struct.unpack("<d", b"\n$Nodes\n")[0]
    nodes = b"".join(struct.pack("<i3d", i + 1, *point) for i, point in enumerate(POINTS))
    tets = struct.pack("<3i", 4, 2, 0) + b"".join(
        struct.pack("<5i", i, *t) for i, t in enumerate(TETS_FROM_1, 1)
    )
    values = b"".join(
        struct.pack("<id", i + 5, line_in_data) for i in range(2)
    )  # numbered as meshio does not expect
    head = b'1\n"quality"\n1\n0.0\n3\n0\n1\n2\n'
    return b"".join(
        [
            b"$MeshFormat\n2.2 1 8\n\x01\x00\x00\x00\n$EndMeshFormat\n",
            b"$Nodes\n5\n" + nodes + closing + b"$EndNodes\n",
            b"$Elements\n2\n" + tets + closing + b"$EndElements\n",
            b"$ElementData\n" + head + values + closing + b"$EndElementData\n",
        ]
    )


TETS_FROM_1 = [[v + 1 for v in t] for t in TETS]

GMSH_1 = """$NOD
5
{}
$ENDNOD
$ELM
4
1 15 0 1 1 1
2 4 7 1 4 1 2 3 4
3 2 7 1 3 1 2 3
4 4 7 1 4 2 3 4 5
$ENDELM
""".format("\n".join(f"{i + 1} {x:g} {y:g} {z:g}" for i, (x, y, z) in enumerate(POINTS)))

MEDIT = """# by hand
MeshVersionFormatted 1
Dimension
3
Vertices 5
0 0 0 0  1 0 0 0  0 1 0 0  0 0 1 0  1 1 1 0
RequiredEdges
1
1
Edges 1
1 2 0
Tetrahedra
2
1 2 3 4 0
2 3 4 5 0
End
"""

BY_HAND = {
    "gmsh1.msh": GMSH_1.encode(),
    "dos.msh": GMSH_1.replace("\n", "\r\n").encode(),
    "binary.msh": binary_22(),
    "pymesh.msh": binary_22(b""),
    "medit.mesh": MEDIT.encode(),
}


@pytest.mark.parametrize("name", BY_HAND)
def test_what_no_meshio_wrote_is_read(tmp_path, name):
    (tmp_path / name).write_bytes(BY_HAND[name])
    assert same(load_mesh(tmp_path / name), PAIR)


def small_files(folder):
    blocks = [("tetra", PAIR.tets)]
    for number, (module, suffix, options) in enumerate(VARIANTS):
        path = folder / f"{number}{suffix}"
        write(path, module, options, with_data(meshio.Mesh(PAIR.vertices, blocks), blocks, "points cells"))
        yield path.name, path.read_bytes()
        if suffix == ".vtk":  # whose cells are then the last
            write(path, module, options, meshio.Mesh(PAIR.vertices, blocks))
            yield path.name, path.read_bytes()
    for name, content in BY_HAND.items():
        (folder / name).write_bytes(content)
        yield name, content


def test_a_file_cut_short_is_refused_unless_what_is_gone_was_no_part_of_the_mesh(tmp_path):
    for name, whole in small_files(tmp_path):
        refused = 0
        path = tmp_path / name
        for end in [*range(0, len(whole), 1 + len(whole) // 200), *range(len(whole) - 30, len(whole))]:
            path.unlink()  # faster than overwriting the file
            path.write_bytes(whole[:end])
            message, found = "", None
            try:
                found = load_mesh(path)
            except MeshError as error:
                message, refused = str(error), end
            assert message or same(found, PAIR), f"{name} cut at {end} of {len(whole)}"
            assert found or (message.startswith(f"{name}: ") and "\n" not in message)
        assert refused > len(whole) / 3


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
def test_binary_sections_that_lost_bytes_in_their_middle_are_refused(tmp_path):
    for name, whole in (("binary.msh", binary_22()), ("pymesh.msh", binary_22(b""))):
        for section in (b"$Nodes\n5\n", b"$Elements\n2\n"):
            start = whole.index(section) + len(section)
            for lost in range(1, 41):
                (tmp_path / name).unlink(missing_ok=True)
                (tmp_path / name).write_bytes(whole[: start + 4] + whole[start + 4 + lost :])
                with pytest.raises(MeshError, match=rf"^{name}: "):
                    load_mesh(tmp_path / name)


def refusal(path):
    with pytest.raises(MeshError) as caught:
        load_mesh(path)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (GMSH_1.replace("$ELM\n4", "$ELM\n5"), r"section \$ELM .*damaged"),
        (GMSH_1.replace("4 2 3 4 5", "5 2 3 4 5"), r"section \$ELM .*damaged"),
        (GMSH_1[: GMSH_1.index("$ELM")], r"\$ELM, only \$NOD"),
        (GMSH_1 + "$NOD\n0\n$ENDNOD\n", r"has two sections \$NOD"),
        ("(0 grid written by Fluent)\n(2 3)\n", r"Gmsh.*'\(0 grid written.*\.vtu"),
    ],
    ids=["short", "wrong width", "no cells", "two meshes", "fluent"],
)
def test_gmsh_files_that_do_not_hold_what_they_say_are_refused(tmp_path, text, reason):
    (tmp_path / "x.msh").write_text(text)
    with pytest.raises(MeshError, match=rf"^x\.msh: .*{reason}"):
        load_mesh(tmp_path / "x.msh")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            MEDIT.replace("Tetrahedra\n2", "Tetrahedra\n3"),
            "Tetrahedra .*3 rows of 5 .*10 numbers: .*cut short",
        ),
        (MEDIT.replace("Dimension\n3", "Dimension 2"), "dimension 2.* 3"),
        (MEDIT.replace("Dimension\n3", "Dimension 3\xac"), "dimension 3.* 3"),
        ("MFEM mesh v1.0\n", "Medit.*'MFEM mesh v1.0"),
    ],
    ids=["short", "flat", "no number", "mfem"],
)
def test_medit_files_that_do_not_hold_what_they_say_are_refused(tmp_path, text, reason):
    (tmp_path / "x.mesh").write_bytes(text.encode("latin-1"))
    with pytest.raises(MeshError, match=rf"^x\.mesh: .*{reason}"):
        load_mesh(tmp_path / "x.mesh")


@pytest.mark.parametrize(
    ("module", "suffix"), [("gmsh", ".msh"), ("vtk", ".vtk"), ("vtu", ".vtu"), ("medit", ".mesh")]
)
def test_cells_beside_the_tetrahedra_are_counted_in_a_warning(tmp_path, module, suffix):
    """A hexahedron and a triangle that stand alone; the triangle that is a face of the body is no loss."""
    options = {"fmt_version": "2.2"} if module == "gmsh" else {}
    cells = [("triangle", [[0, 1, 2], [5, 6, 7]]), ("tetra", TETS), ("hexahedron", HEXAHEDRON)]
    blocks = [cells[0], cells[1], cells[2]]
    write(tmp_path / f"x{suffix}", module, options, meshio.Mesh(np.array(POINTS + CUBE), blocks))
    with pytest.warns(
        SkippedCellsWarning,
        match=rf"^x\{suffix}: .*1 triangle, 1 hexahedron.*2 tetrahedra.*divide",
    ) as caught:
        assert same(load_mesh(tmp_path / f"x{suffix}"), PAIR)
    assert caught[0].filename == __file__


def vtu(kinds, connectivity, offsets, pieces=1):
    def array(name, kind, values):
        text = " ".join(str(value) for value in values)
        return (
            f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="1" format="ascii">{text}</DataArray>'
        )

    points = np.array(POINTS + CUBE + CUBE[:4])
    cells = {"connectivity": connectivity, "offsets": offsets, "types": kinds}
    piece = (
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(kinds)}"><Points>'
        + array("Points", "Float64", points.reshape(-1)).replace('Components="1"', 'Components="3"')
        + "</Points><Cells>"
        + "".join(
            array(name, "Int64", values).replace('NumberOfComponents="1" ', "")
            for name, values in cells.items()
        )
        + "</Cells></Piece>"
    )
    return f'<VTKFile type="UnstructuredGrid"><UnstructuredGrid>{piece * pieces}</UnstructuredGrid></VTKFile>'


def test_cells_that_meshio_drops_by_itself_are_counted_too(tmp_path):
    voxel = 11
    (tmp_path / "x.vtu").write_text(vtu([10, 10, voxel], [*np.ravel(TETS), *HEXAHEDRON[0]], [4, 8, 16]))
    with pytest.warns(SkippedCellsWarning, match=r"x\.vtu: .*1 of kinds"):
        assert same(load_mesh(tmp_path / "x.vtu"), PAIR)


def test_cells_that_meshio_stumbles_over_are_named(tmp_path):
    (tmp_path / "x.vtu").write_text(vtu([10, 10, 16], [*np.ravel(TETS), *range(5, 17)], [4, 8, 20]))
    assert (
        "meshio does not know 'hexa_prism': if that is a kind of cell, save only the tetrahedra"
        in refusal(tmp_path / "x.vtu")
    )


def test_a_grid_in_pieces_of_which_meshio_reads_the_last_is_refused(tmp_path):
    (tmp_path / "x.vtu").write_text(vtu([10, 10], np.ravel(TETS), [4, 8], pieces=2))
    assert re.search(r"2 pieces.*: join them", refusal(tmp_path / "x.vtu"))


def test_a_silent_refusal_of_meshio_is_put_in_words(tmp_path):
    save_mesh(BALL, tmp_path / "x.vtu")
    text = (tmp_path / "x.vtu").read_text().replace("<Points>", "<Points><DataArray/>")
    (tmp_path / "x.vtu").write_text(text)
    assert re.search(r"ReadError .*: the file is damaged.*Save it again", refusal(tmp_path / "x.vtu"))


@pytest.mark.parametrize("suffix", [".npz", ".node", ".ele", ".msh", ".vtk", ".vtu", ".mesh"])
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n",
            "a Git LFS pointer.*`git lfs pull`",
        ),
        ("\n<!DOCTYPE html><html></html>", "a web page, .*: download the raw file"),
    ],
    ids=["lfs", "page"],
)
def test_what_stands_in_the_place_of_a_file_is_recognised(tmp_path, suffix, text, reason):
    save_mesh(BALL, tmp_path / f"x{suffix}")
    (tmp_path / f"x{suffix}").write_text(text)
    with pytest.raises(MeshError, match=rf"^x\{suffix}: {reason}"):
        load_mesh(tmp_path / f"x{suffix}")


def test_an_xml_file_under_the_suffix_of_the_older_format_is_told_its_own(tmp_path):
    save_mesh(BALL, tmp_path / "x.vtu")
    (tmp_path / "x.vtu").rename(tmp_path / "x.vtk")
    assert re.fullmatch(r"x\.vtk: .*XML.*: give it the suffix \.vtu", refusal(tmp_path / "x.vtk"))


def test_archives_under_other_names_are_told_theirs_and_the_wanted_ones(tmp_path):
    np.savez(tmp_path / "x.npz", T=np.array(TETS), V=np.array(POINTS))
    assert (
        "arrays 'vertices' (n, 3) and 'tets' (m, 4), but the file has 'T', 'V': pass its arrays"
        in refusal(tmp_path / "x.npz")
    )


POLYDATA = "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET POLYDATA\nPOINTS 0 float\n"


def test_the_command_that_an_unknown_format_is_refused_with_makes_a_known_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "x.inp", "abaqus", {}, meshio.Mesh(PAIR.vertices, [("tetra", PAIR.tets)]))
    (command,) = re.findall("`meshio (.*?)`", refusal(tmp_path / "x.inp"))
    with contextlib.redirect_stdout(io.StringIO()):
        assert not importlib.import_module("meshio._cli").main(command.split())
    assert same(load_mesh(tmp_path / "x.vtu"), PAIR)


def test_surfaces_are_refused_with_the_way_to_fill_them(tmp_path):
    fill = "SoftBodyAsset.from_surface('x.stl', material) makes a body from it"
    faces = meshio.Mesh(BALL.vertices, [("triangle", BALL.surface)])
    write(tmp_path / "x.vtk", "vtk", {}, faces)
    write(tmp_path / "x.msh", "gmsh", {}, faces)
    (tmp_path / "y.vtk").write_text(POLYDATA)
    assert (
        f"x.msh: contains no tetrahedra, only 80 triangle, which is a surface: save it as x.stl, then {fill}"
        in refusal(tmp_path / "x.msh")
    )
    assert fill in refusal(tmp_path / "x.vtk")
    assert fill.replace("x.stl", "y.stl") in refusal(tmp_path / "y.vtk")
    assert f"x.stl: a surface, which has no tetrahedra: {fill}" in refusal(tmp_path / "x.stl")


def test_files_of_other_cells_only_say_what_they_lack(tmp_path):
    flat = np.array(POINTS) * (1, 1, 0)
    write(tmp_path / "flat.vtk", "vtk", {}, meshio.Mesh(flat, [("triangle", [[0, 1, 2]])]))
    assert refusal(tmp_path / "flat.vtk").endswith(
        "only 1 triangle, all in one plane: a body needs a thickness"
    )
    write(tmp_path / "hex.vtk", "vtk", {}, meshio.Mesh(np.array(POINTS + CUBE), [("hexahedron", HEXAHEDRON)]))
    assert "only 1 hexahedron: divide them into tetrahedra" in refusal(tmp_path / "hex.vtk")
    write(tmp_path / "line.vtk", "vtk", {}, meshio.Mesh(np.array(POINTS), [("line", [[0, 1]])]))
    assert refusal(tmp_path / "line.vtk").endswith("only 1 line: save the cells that fill the body too")


@pytest.mark.parametrize("suffix", [".npz", ".node", ".msh", ".vtk", ".vtu", ".mesh"])
def test_a_mesh_of_a_single_tetrahedron_comes_back(tmp_path, suffix):
    corner = TetMesh(np.array(POINTS[:4]), np.array(TETS[:1]), fix_orientation=True)
    save_mesh(corner, tmp_path / f"x{suffix}")
    assert same(load_mesh(tmp_path / f"x{suffix}"), corner)


def test_a_tetgen_file_that_ends_after_its_head_is_cut_short(tmp_path):
    save_mesh(BALL, tmp_path / "x.node")
    lines = (tmp_path / "x.ele").read_text().splitlines()
    head = next(line for line in lines if not line.startswith("#"))
    (tmp_path / "x.ele").write_text(f"{head}\n")
    assert f"{head.split()[0]} tetrahedra and has 0: the file is cut short" in refusal(tmp_path / "x.node")
