"""Grids cached on disk: they are reused, damaged files are ignored, and no cache error is fatal."""

import numpy as np
import pytest
import trimesh

import taichi_soft.contact.shapes.mesh as mesh_module
from taichi_soft import MeshShape
from taichi_soft.contact.shapes.grid_cache import cache_folder as default_folder

pytestmark = pytest.mark.kernel

CUBE = trimesh.creation.box((1, 1, 1))
BALL = trimesh.creation.icosphere(subdivisions=1)
CELL = 0.1


@pytest.fixture
def computed(monkeypatch):
    """Return a list to which an item is added for each grid that is computed."""
    calls, compute = [], mesh_module.distance_grid

    def spy(*arguments):
        calls.append(arguments)
        return compute(*arguments)

    monkeypatch.setattr(mesh_module, "distance_grid", spy)
    return calls


def test_the_second_time_nothing_is_computed(computed, cache_folder):
    first = MeshShape(CUBE, cell=CELL)
    again = MeshShape(CUBE, cell=CELL)
    assert len(computed) == 1
    np.testing.assert_array_equal(again.samples, first.samples)
    assert again.resolution == first.resolution
    assert len(list(cache_folder.iterdir())) == 1


def test_another_mesh_cell_or_winding_has_a_grid_of_its_own(computed, cache_folder):
    shifted = CUBE.copy().apply_translation((1e-3, 0, 0))
    for mesh, cell in ((CUBE, 0.1), (CUBE, 0.11), (shifted, 0.1), (BALL, 0.1)):
        MeshShape(mesh, cell=cell)
    assert len(computed) == len(list(cache_folder.iterdir())) == 4


def test_without_cache_no_file_is_read_or_written(computed, cache_folder):
    MeshShape(CUBE, cell=CELL, cache=False)
    assert not cache_folder.exists()
    MeshShape(CUBE, cell=CELL)
    MeshShape(CUBE, cell=CELL, cache=False)
    assert len(computed) == 3


def flip_a_bit(content):
    return content[:500] + bytes([content[500] ^ 1]) + content[501:]


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-4],
        lambda content: content + b"\0\0\0\0",
        lambda content: b"\0" * len(content),
        lambda content: bytes([content[0] ^ 1]) + content[1:],
        flip_a_bit,
    ],
)
def test_a_damaged_file_is_computed_and_written_anew(damage, computed, cache_folder):
    whole = MeshShape(CUBE, cell=CELL)
    (file,) = cache_folder.iterdir()
    content = file.read_bytes()
    file.write_bytes(damage(content))
    again = MeshShape(CUBE, cell=CELL)
    assert len(computed) == 2
    np.testing.assert_array_equal(again.samples, whole.samples)
    assert file.read_bytes() == content


def test_a_file_of_another_mesh_is_not_taken(computed, cache_folder):
    """The other mesh has the same size. Only the name of its file is wrong."""
    MeshShape(CUBE, cell=CELL)
    (file,) = cache_folder.iterdir()
    other = file.read_bytes()
    MeshShape(CUBE.copy().apply_translation((0, 0, 3)), cell=CELL)
    (second,) = set(cache_folder.iterdir()) - {file}
    second.write_bytes(other)
    MeshShape(CUBE.copy().apply_translation((0, 0, 3)), cell=CELL)
    assert len(computed) == 3


def test_a_folder_that_cannot_be_written_is_no_error(computed, cache_folder):
    cache_folder.write_text("a file where the folder should be")
    for _ in range(2):
        MeshShape(CUBE, cell=CELL)
    assert len(computed) == 2


def test_a_file_that_cannot_be_replaced_leaves_nothing_behind(computed, cache_folder):
    MeshShape(CUBE, cell=CELL)
    (file,) = cache_folder.iterdir()
    file.unlink()
    (file / "in the way").mkdir(parents=True)
    MeshShape(CUBE, cell=CELL)
    assert len(computed) == 2
    assert list(cache_folder.iterdir()) == [file]


@pytest.mark.parametrize(
    ("platform", "variable", "end"),
    [
        ("linux", "XDG_CACHE_HOME", ("chosen", "taichi-soft")),
        ("linux", None, (".cache", "taichi-soft")),
        ("darwin", None, ("Library", "Caches", "taichi-soft")),
        ("win32", "LOCALAPPDATA", ("chosen", "taichi-soft")),
    ],
)
def test_the_usual_folder_is_the_systems(platform, variable, end, monkeypatch, tmp_path):
    for name in ("TAICHI_SOFT_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    if variable:
        monkeypatch.setenv(variable, str(tmp_path / "chosen"))
    monkeypatch.setattr("sys.platform", platform)
    assert default_folder().parts[-len(end) :] == end
