"""Mesh files: written files are read back, files of other programs are read, invalid files are refused."""

import os
import sys

import numpy as np
import pytest

from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing import ParticleMesh, TetMesh, load_mesh, save_mesh, sphere

pytestmark = pytest.mark.numpy

MESH = sphere(1.0, 2).translated([0.1, 1 / 3, -1e-7])
OWN = [".npz", ".node", ".ele"]
WITH_MESHIO = [".msh", ".vtk", ".vtu", ".mesh"]


def needs(suffix):
    if suffix in WITH_MESHIO:
        pytest.importorskip("meshio")


@pytest.mark.parametrize("suffix", OWN + WITH_MESHIO)
def test_round_trip_keeps_every_digit(tmp_path, suffix):
    needs(suffix)
    save_mesh(MESH, tmp_path / f"ball{suffix}")
    again = load_mesh(tmp_path / f"ball{suffix}", fix_orientation=False)
    assert again.tets.tolist() == MESH.tets.tolist()
    assert again.vertices.tolist() == MESH.vertices.tolist()
    assert not [name for name in os.listdir(tmp_path) if name.endswith(".tmp")]


def test_own_format_is_the_same_bytes_every_time(tmp_path):
    for name in ("a.npz", "b.npz"):
        save_mesh(MESH, tmp_path / name)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


NODES = "# points\n\n5 3 1 1  # attributes and markers\n{}\n"
ROWS = ["0 0 0", "1 0 0", "0 1 0", "0 0 1", "1 1 1"]


@pytest.mark.parametrize("base", [0, 1])
def test_tetgen_counts_from_zero_or_one(tmp_path, base):
    rows = [f"{i + base}  {row}  0.5 1" for i, row in enumerate(ROWS)]
    (tmp_path / "m.1.node").write_text(NODES.format("\n# a comment between\n".join(rows)) + "\n")
    (tmp_path / "m.1.ele").write_text(
        "2 4 1\n"
        + "\n".join(f"{i + base} " + " ".join(str(v + base) for v in t) + " 7" for i, t in TETS)
        + "\n"
    )
    for suffix in ("node", "ele"):
        mesh = load_mesh(tmp_path / f"m.1.{suffix}")
        assert mesh.vertices.tolist() == [[float(x) for x in row.split()] for row in ROWS]
        assert [sorted(t) for t in mesh.tets.tolist()] == [[0, 1, 2, 3], [1, 2, 3, 4]]


TETS = [(0, (0, 1, 2, 3)), (1, (1, 2, 3, 4))]

MSH22 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
6
1 0 0 0
2 1 0 0
3 9 9 9
4 0 1 0
5 0 0 1
6 1 1 1
$EndNodes
$Elements
4
1 15 2 0 1 3
2 4 2 0 1 1 2 4 5
3 2 2 0 1 1 2 4
4 4 2 0 1 4 2 5 6
$EndElements
"""
MSH41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
1 0 0 2
1 9 9 9 0
1 0 0 0 1 1 1 0 0
2 0 0 0 1 1 1 0 0
$EndEntities
$Nodes
2 6 1 6
0 1 0 1
3
9 9 9
3 1 0 5
1
2
4
5
6
0 0 0
1 0 0
0 1 0
0 0 1
1 1 1
$EndNodes
$Elements
3 3 1 3
0 1 15 1
1 3
3 1 4 1
2 1 2 4 5
3 2 4 1
3 4 2 5 6
$EndElements
"""
VTK = """# vtk DataFile Version 3.0
by hand
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 6 float
0 0 0  1 0 0  9 9 9  0 1 0  0 0 1  1 1 1
CELLS 3 14
4 0 1 3 4
3 0 1 3
4 3 1 4 5
CELL_TYPES 3
10
5
10
"""


@pytest.mark.parametrize(("name", "text"), [("a.msh", MSH22), ("b.msh", MSH41), ("c.vtk", VTK)])
def test_foreign_files_with_other_cells_and_an_unused_point(tmp_path, name, text):
    """The file has points, triangles, and two tetrahedra in separate blocks, one of which is inverted."""
    pytest.importorskip("meshio")
    (tmp_path / name).write_text(text)
    mesh = load_mesh(tmp_path / name)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
    assert mesh.volume == pytest.approx(1 / 6 + 1 / 3)
    with pytest.raises(MeshError, match=f"{name}: tetrahedron 1 has volume"):
        load_mesh(tmp_path / name, fix_orientation=False)


@pytest.mark.parametrize("suffix", OWN + WITH_MESHIO)
@pytest.mark.parametrize("part", [0.0, 0.02, 0.3, 0.6, 0.9])
def test_files_cut_short_are_refused(tmp_path, capfd, suffix, part):
    needs(suffix)
    path = tmp_path / f"ball{suffix}"
    save_mesh(MESH, path)
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    with pytest.raises(MeshError, match=r"^ball\.") as caught:
        load_mesh(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", [".msh", ".vtk", ".node", ".ele"])
def test_text_cut_short_by_any_of_its_last_letters_is_refused(tmp_path, suffix):
    """A text whose last number lacks a digit may still look like a valid mesh."""
    needs(suffix)
    path = tmp_path / f"ball{suffix}"
    save_mesh(MESH, path)
    whole = path.read_bytes()
    for missing in range(1, 60):
        path.write_bytes(whole[:-missing])
        if suffix == ".msh" and missing == 1:
            continue  # only the newline after the end
        with pytest.raises(MeshError, match=r"^ball\."):
            load_mesh(path)


@pytest.mark.parametrize("suffix", OWN + WITH_MESHIO)
@pytest.mark.parametrize(
    "content", [b"", b"\x00\xff\xfe" * 50, b"hello\nworld\n", b"\x89PNG\r\n", b"1 2 3 4\n"]
)
def test_files_that_are_no_meshes_are_refused(tmp_path, capfd, suffix, content):
    needs(suffix)
    for other in {suffix, ".node", ".ele"} if suffix in (".node", ".ele") else {suffix}:
        (tmp_path / f"x{other}").write_bytes(content)
    with pytest.raises(MeshError, match=r"^x\.") as caught:
        load_mesh(tmp_path / f"x{suffix}")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", OWN + WITH_MESHIO)
def test_missing_files_and_folders_are_refused(tmp_path, suffix):
    needs(suffix)
    with pytest.raises(MeshError, match=r"x\.\w+: .*read.*No such file"):
        load_mesh(tmp_path / f"x{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(MeshError, match=r"folder\.\w+: cannot be read"):
        load_mesh(tmp_path / f"folder{suffix}")


def test_the_other_half_of_a_pair_is_named_when_missing(tmp_path):
    save_mesh(MESH, tmp_path / "ball.node")
    (tmp_path / "ball.ele").unlink()
    with pytest.raises(MeshError, match=r"ball\.ele: cannot be read"):
        load_mesh(tmp_path / "ball.node")


@pytest.mark.parametrize("name", ["x.inp", "x", ".npz"])
def test_unknown_formats_are_refused(tmp_path, name):
    for call in (lambda p: load_mesh(p), lambda p: save_mesh(MESH, p)):
        with pytest.raises(MeshError, match=r"unknown mesh format.*\.npz.*\.vtu"):
            call(tmp_path / name)


@pytest.mark.parametrize("path", [None, 5, "", ".", "/"])
def test_what_names_no_file_is_refused(path):
    for call in (load_mesh, lambda p: save_mesh(MESH, p)):
        with pytest.raises(OptionError, match="path"):
            call(path)


@pytest.mark.parametrize("suffix", [".node", ".ele"])
@pytest.mark.parametrize("broken", [".node", ".ele"])
def test_the_broken_half_of_a_pair_is_named(tmp_path, suffix, broken):
    save_mesh(MESH, tmp_path / "ball.node")
    (tmp_path / f"ball{broken}").write_bytes(b"\x00\xff\xfe" * 50)
    with pytest.raises(MeshError, match=rf"^ball\{broken}: not a text file"):
        load_mesh(tmp_path / f"ball{suffix}")


def test_files_without_tetrahedra_are_refused(tmp_path):
    pytest.importorskip("meshio")
    text = VTK.replace("4 0 1 3 4\n", "").replace("4 3 1 4 5\n", "").replace("10\n5\n10", "5")
    (tmp_path / "x.vtk").write_text(text.replace("CELLS 3 14", "CELLS 1 4").replace("TYPES 3", "TYPES 1"))
    with pytest.raises(MeshError, match=r"x\.vtk: .*1 triangle"):
        load_mesh(tmp_path / "x.vtk")


def test_archives_of_other_things_are_refused(tmp_path):
    np.savez(tmp_path / "x.npz", vertices=np.eye(3))
    with pytest.raises(MeshError, match=r"x\.npz: .*'tets'.*'vertices'.*save_mesh"):
        load_mesh(tmp_path / "x.npz")
    np.savez(tmp_path / "y.npz", vertices=np.array([{}], dtype=object), tets=np.eye(4))
    with pytest.raises(MeshError, match=r"y\.npz: not a mesh file"):
        load_mesh(tmp_path / "y.npz")


def test_archives_without_tables_are_refused(tmp_path):
    np.savez(tmp_path / "x.npz", vertices=np.float64(3), tets=MESH.tets)
    with pytest.raises(MeshError, match=r"x\.npz: vertices.*tets"):
        load_mesh(tmp_path / "x.npz")


def test_a_name_too_long_for_the_disk_is_refused(tmp_path):
    with pytest.raises(MeshError, match="cannot be written"):
        save_mesh(MESH, tmp_path / ("x" * 250 + ".npz"))


def test_a_missing_meshio_is_explained(tmp_path, monkeypatch):
    for name in [n for n in sys.modules if n.split(".")[0] == "meshio"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "meshio", None)
    (tmp_path / "x.msh").write_text(MSH22)
    for call in (lambda p: load_mesh(p), lambda p: save_mesh(MESH, p)):
        with pytest.raises(MeshError, match=r'pip install "taichi-soft\[io\]"'):
            call(tmp_path / "x.msh")


def test_targets_that_cannot_be_written_are_refused(tmp_path):
    with pytest.raises(MeshError, match=r"x\.npz: .*written.*No such file"):
        save_mesh(MESH, tmp_path / "nowhere" / "x.npz")
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(MeshError, match=r"folder\.npz: cannot be written"):
        save_mesh(MESH, tmp_path / "folder.npz")
    assert os.listdir(tmp_path) == ["folder.npz"]


@pytest.mark.parametrize("suffix", OWN)
def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"ball{suffix}"
    save_mesh(MESH, path)
    before = {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("taichi_soft.meshing.io._write_npz", full)
    monkeypatch.setattr("taichi_soft.meshing.io.write_elements", full)
    with pytest.raises(MeshError, match="No space left"):
        save_mesh(TetMesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2, 3]]), path)
    assert {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)} == before


def test_only_tetrahedral_meshes_are_saved(tmp_path):
    with pytest.raises(MeshError, match="ParticleMesh"):
        save_mesh(ParticleMesh(np.eye(3), [[0, 1], [1, 2]], 1.0), tmp_path / "x.npz")
