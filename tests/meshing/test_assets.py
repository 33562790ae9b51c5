"""The mesh files have the properties that assets/README.md lists."""

import re
from pathlib import Path

import numpy as np
import pytest

from taichi_soft.meshing import load_mesh

pytestmark = pytest.mark.numpy

FOLDER = Path(__file__).parents[2] / "assets"
ROWS = dict(re.findall(r"^\| `(\w+)\.npz` \| (.*) \|$", (FOLDER / "README.md").read_text(), re.MULTILINE))


def test_every_file_has_its_row():
    assert sorted(ROWS) == sorted(path.stem for path in FOLDER.glob("*.npz"))
    assert sum(path.stat().st_size for path in FOLDER.iterdir() if path.is_file()) < 2_000_000


@pytest.mark.parametrize("name", ROWS)
def test_files_are_as_stated(name):
    vertices, tets, size, volume, angle, edge = ROWS[name].split(" | ")
    mesh = load_mesh(FOLDER / f"{name}.npz", fix_orientation=False)
    assert (len(mesh.vertices), len(mesh.tets)) == (int(vertices), int(tets))
    assert np.ptp(mesh.bounds, axis=0) == pytest.approx([float(s) for s in size.split(" x ")], abs=0.006)
    assert mesh.volume == pytest.approx(float(volume), abs=1e-4)
    assert mesh.quality.min_dihedral.min() == pytest.approx(float(angle), abs=0.06)
    assert mesh.quality.shortest_edge == pytest.approx(float(edge), abs=6e-4)


@pytest.mark.parametrize(("name", "holes"), [(n, 1 if n == "beam_with_hole" else 0) for n in ROWS])
def test_files_are_one_solid_piece(name, holes):
    """Euler characteristic of the solid (1 - holes) and of its surface (2 - 2 holes)."""
    mesh = load_mesh(FOLDER / f"{name}.npz")
    faces = (4 * len(mesh.tets) + len(mesh.surface)) // 2
    assert len(mesh.vertices) - len(mesh.edges) + faces - len(mesh.tets) == 1 - holes
    assert len(mesh.surface_vertices) - len(mesh.surface) // 2 == 2 - 2 * holes


def test_the_thesis_sphere():
    mesh = load_mesh(FOLDER / "sphere.npz")
    assert mesh.volume == pytest.approx(4.0, rel=1e-12)
    assert len(mesh.vertices) == 381
    assert len(mesh.tets) == pytest.approx(955, rel=0.02)
    distance = np.linalg.norm(mesh.vertices[mesh.surface_vertices], axis=1)
    assert np.ptp(distance) < 1e-12


@pytest.mark.parametrize(
    ("name", "height", "radius"), [("cylinder_long", 4, 0.75), ("cylinder_flat", 0.5, 1)]
)
def test_ends_of_cylinders_are_flat(name, height, radius):
    mesh = load_mesh(FOLDER / f"{name}.npz")
    for end in (-height / 2, height / 2):
        on_end = mesh.vertices[:, 2] == end
        corner = mesh.vertices[mesh.surface]
        a, b, c = np.moveaxis(corner[on_end[mesh.surface].all(axis=1)], 1, 0)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        rim = int(np.isclose(np.hypot(*mesh.vertices[on_end, :2].T), radius).sum())
        assert area == pytest.approx(rim / 2 * radius**2 * np.sin(2 * np.pi / rim))
