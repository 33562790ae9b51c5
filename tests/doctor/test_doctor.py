"""The doctor: defects that it counts, its report about a body, and its repairs."""

import json

import numpy as np
import pytest
import trimesh
from difficult_surfaces import REFUSED
from gltf_writer import GltfWriter
from surfaces import ball, joined, with_some_turned, with_triangles, without

from taichi_soft import Material, MeshError, box, save_mesh
from taichi_soft.cli import main
from taichi_soft.core.extras import missing_packages
from taichi_soft.doctor import Grade, diagnose
from taichi_soft.doctor.mending import write_mended
from taichi_soft.doctor.triangle_facts import facts_of
from taichi_soft.meshing.surfaces import read_surfaces

pytestmark = [pytest.mark.soak, pytest.mark.guard]

RUBBER = Material(young=5e5, poisson=0.4, density=1000.0)
BALL = ball(0.5)


def facts(mesh):
    return facts_of(read_surfaces(mesh))


def run(*arguments):
    """Run a command, and return its exit code."""
    with pytest.raises(SystemExit) as ended:
        main(*arguments)
    return ended.value.code


def written(mesh, path):
    mesh.export(path)
    return path


def test_a_closed_surface_has_nothing_to_be_told():
    found = facts(BALL)
    assert found.open_edges == found.turned_edges == found.crowded_edges == 0
    assert found.flat_triangles == found.repeated_triangles == 0
    assert found.parts == 1
    assert found.size == pytest.approx(1.0, rel=0.01)


def test_open_edges_are_counted_round_each_hole():
    """A triangle without neighbours that lack theirs leaves three."""
    assert facts(with_triangles(BALL, BALL.faces[1:])).open_edges == 3
    unwelded = BALL.copy()
    unwelded.unmerge_vertices()
    assert facts(unwelded).open_edges == 0


def test_a_triangle_turned_round_has_three_edges_that_run_twice_the_same_way():
    faces = BALL.faces.copy()
    faces[7] = faces[7][::-1]
    assert facts(with_triangles(BALL, faces)).turned_edges == 3


def test_parts_flat_and_repeated_triangles_are_counted():
    rubbish = with_triangles(BALL, np.vstack([BALL.faces, BALL.faces[:4], [[0, 0, 1], [2, 2, 2]]]))
    found = facts(joined(rubbish, ball(0.1, at=(3, 0, 0))))
    assert (found.parts, found.flat_triangles, found.repeated_triangles) == (2, 2, 4)


def test_a_sound_file_would_simulate_and_its_body_is_told(tmp_path):
    found = diagnose(written(BALL, tmp_path / "ball.stl"), RUBBER, cells=5)
    assert found.is_fit
    assert found.figures["mass [kg]"] == pytest.approx(1000 * BALL.volume, rel=0.01)
    assert found.figures["least dihedral angle [degrees]"] >= 10
    assert found.figures["milliseconds of a 60 Hz frame here"] > 0
    assert {each.grade for each in found.findings} == {Grade.GOOD}


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("size", [0.0, 1e-30, 1e-9, 1e9, 1e25])
@pytest.mark.parametrize("place", [0.0, 5.0, 1e15, 1e29])
def test_nothing_is_divided_by_zero_or_too_large_whatever_the_size_and_place(size, place):
    """NumPy would print warnings beside what the doctor says."""
    cube = trimesh.creation.box()
    found = facts_of(read_surfaces((size * cube.vertices + place, cube.faces)))
    assert found.triangles == 12


def test_the_axis_that_was_assumed_is_named_with_the_other_one(tmp_path):
    file = tmp_path / "x.obj"
    file.write_text(3 * "v 5 5 5\n" + "f 1 2 3\n")
    told = " ".join(each.text for each in diagnose(file, RUBBER).findings)
    assert "y is taken as up" in told
    assert "up='z'" in told
    assert "taken as up" not in " ".join(each.text for each in diagnose(file, RUBBER, up="z").findings)


@pytest.mark.parametrize("suffix", ["obj", "ply", "glb"])
def test_a_mended_file_stands_as_its_broken_one_does(tmp_path, suffix):
    tall = trimesh.creation.box((1.0, 2.0, 3.0))
    write_mended(read_surfaces(tall), tmp_path / f"tall.{suffix}")
    surfaces = read_surfaces(tmp_path / f"tall.{suffix}")
    np.testing.assert_allclose(np.ptp(surfaces[0].vertices, axis=0), (1.0, 2.0, 3.0), atol=1e-6)
    a, b, c = np.moveaxis(surfaces[0].vertices[surfaces[0].triangles], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(6.0)


@pytest.mark.parametrize("name", REFUSED)
def test_what_makes_no_body_is_bad(tmp_path, name):
    found = diagnose(written(REFUSED[name], tmp_path / "x.ply"), RUBBER)
    assert not found.is_fit
    assert "thickness" in found.findings[-1].text


def test_another_unit_is_suspected_in_words(tmp_path):
    large = BALL.copy().apply_scale(2000.0)
    stiff = Material(young=1e9, poisson=0.4, density=1000.0)
    found = diagnose(written(large, tmp_path / "duck.stl"), stiff, cells=4)
    assert any("millimetres" in each.text for each in found.findings)
    tiny = diagnose(written(BALL.copy().apply_scale(0.002), tmp_path / "tiny.stl"), RUBBER, cells=4)
    assert any("0.002 m long" in each.text for each in tiny.findings)


def test_what_cannot_bear_its_weight_is_told_what_could(tmp_path):
    soft = Material(young=5e3, poisson=0.4, density=1000.0)
    found = diagnose(written(BALL, tmp_path / "ball.stl"), soft, cells=4)
    assert any("own weight" in each.text for each in found.findings)
    assert not found.is_fit


def test_what_is_thinner_than_a_cell_is_noted(tmp_path):
    sheet = trimesh.creation.box((1.0, 1.0, 0.01))
    found = diagnose(written(sheet, tmp_path / "sheet.stl"), RUBBER, cells=6)
    assert any("thinner than a cell" in each.text for each in found.findings)


@pytest.mark.skipif(bool(missing_packages("ftetwild")), reason="needs pytetwild: the extra ftetwild")
def test_legs_too_thin_for_the_cells_are_noted_with_what_they_cost(tmp_path):
    leg = trimesh.creation.box((0.01, 0.01, 1.0)).apply_translation((0.0, 0.0, -0.8))  # a 30th of a cell
    found = diagnose(written(joined(BALL, leg), tmp_path / "stilt.stl"), RUBBER, cells=6)
    notes = " ".join(each.text for each in found.findings if each.grade is Grade.NOTE)
    assert found.is_fit
    assert "too thin for cells" in notes
    assert "times as many substeps" in notes
    assert f"{found.figures['tetrahedra']:,} tetrahedra" in notes


def test_another_method_makes_another_body(tmp_path, capsys):
    file = written(ball(0.5, 2), tmp_path / "ball.stl")
    found = diagnose(file, RUBBER, cells=5, method="ftetwild")
    assert found.is_fit
    assert found.figures["mass [kg]"] == pytest.approx(1000 * ball(0.5, 2).volume, rel=0.03)
    assert found.figures["tetrahedra"] != diagnose(file, RUBBER, cells=5).figures["tetrahedra"]
    assert run("doctor", str(file), "--cells", "5", "--method", "voxels") != 0
    assert "'ftetwild'" in "".join(capsys.readouterr())


@pytest.mark.skipif(bool(missing_packages("tetgen")), reason="needs tetgen: the extra of that name")
def test_what_a_mesher_refuses_is_bad_with_the_way_out(tmp_path):
    found = diagnose(written(without(BALL, 0.02), tmp_path / "open.ply"), RUBBER, method="tetgen")
    assert not found.is_fit
    assert "method='lattice'" in found.findings[-1].text


def test_tetrahedra_are_looked_at_too(tmp_path):
    save_mesh(box((1, 1, 1), (2, 2, 2)), tmp_path / "block.npz")
    found = diagnose(tmp_path / "block.npz", RUBBER)
    assert found.is_fit
    assert found.surface is None
    assert found.figures["mass [kg]"] == pytest.approx(1000.0)


def test_mending_turns_triangles_outwards_and_leaves_out_what_counts_for_nothing(tmp_path):
    broken = with_some_turned(BALL, 0.1)
    broken = with_triangles(broken, np.vstack([broken.faces, broken.faces[:5], [[0, 0, 1]]]))
    left_out, turned = write_mended(read_surfaces(broken), tmp_path / "out.ply")
    mended = trimesh.load_mesh(tmp_path / "out.ply", process=False)
    assert left_out == 6
    assert turned == (np.einsum("ij,ij->i", broken.face_normals, broken.triangles_center)[:-6] < 0).sum()
    assert (np.einsum("ij,ij->i", mended.face_normals, mended.triangles_center) > 0).all()
    assert mended.volume == pytest.approx(BALL.volume, rel=1e-4)


def test_mending_keeps_texture_coordinates(tmp_path):
    crate = trimesh.creation.box()
    crate.unmerge_vertices()
    uv = np.random.default_rng(0).random((len(crate.vertices), 2))
    crate.visual = trimesh.visual.TextureVisuals(uv=uv)
    write_mended(read_surfaces(crate), tmp_path / "crate.glb")
    (found,) = read_surfaces(tmp_path / "crate.glb", up="z")
    np.testing.assert_allclose(found.visual.uv, uv, atol=1e-6)


def test_mending_into_another_kind_of_file_is_refused_and_writes_nothing(tmp_path):
    with pytest.raises(MeshError, match="unknown surface format"):
        write_mended(read_surfaces(BALL), tmp_path / "out.fbx")
    assert list(tmp_path.iterdir()) == []


def test_the_command_ends_with_one_where_nothing_would_simulate(tmp_path, capsys):
    good = written(BALL, tmp_path / "ball.stl")
    assert run("doctor", str(good), "--cells", "5", "--material", "soft_rubber") == 0
    assert "it can be simulated" in capsys.readouterr().out
    bad = written(REFUSED["single triangle"], tmp_path / "bad.stl")
    assert run("doctor", str(bad), "--json") == 1
    said = json.loads(capsys.readouterr().out)
    assert said["would_simulate"] is False
    assert said["surface"]["triangles"] == 1


def test_the_command_mends(tmp_path, capsys):
    bad = written(with_some_turned(without(BALL, 0.02), 0.1), tmp_path / "bad.ply")
    arguments = "--cells", "5", "--material", "soft_rubber", "--fix", str(tmp_path / "out.glb")
    assert run("doctor", str(bad), *arguments) == 0
    assert "flipped" in capsys.readouterr().out
    assert (tmp_path / "out.glb").is_file()


def test_what_a_gltf_file_has_besides_its_surface_is_told(tmp_path):
    """The surface is flat, so that no body is made."""
    writer = GltfWriter()
    writer.node(mesh=writer.mesh(triangles=np.array([[0, 1, 2]], np.uint16)))
    writer.add("animations", name="run", channels=[], samplers=[])
    writer.json["extensionsUsed"] = ["KHR_materials_unlit"]
    found = diagnose(writer.write(tmp_path / "flat.glb"), RUBBER)
    notes = [each.text for each in found.findings if each.grade is Grade.NOTE]
    assert notes[:2] == ["1 animation (run): not played", "extensions: KHR_materials_unlit (ignored)"]
    assert not found.is_fit
