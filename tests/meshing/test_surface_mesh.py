"""Surfaces as meshes of trimesh, which checks that they are closed and face outwards."""

import numpy as np
import pytest
import trimesh

from taichi_soft import MeshError, ParticleMesh, beam, box, cylinder, load_mesh, sphere, surface_mesh, torus
from taichi_soft.core.package_data import ASSETS

pytestmark = pytest.mark.numpy

SHAPES = {"box": box(), "beam": beam(), "sphere": sphere(), "cylinder": cylinder(), "torus": torus()}
SHAPES |= {path.stem: load_mesh(path) for path in sorted(ASSETS.glob("*.npz"))}


@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_and_asset_is_closed_and_holds_its_volume(name):
    """The volume by the divergence theorem over the triangles equals the sum over the tetrahedra."""
    mesh = SHAPES[name]
    surface = surface_mesh(mesh)
    assert surface.is_watertight
    assert surface.is_winding_consistent
    assert surface.volume == pytest.approx(mesh.volume, rel=1e-9)
    assert surface.area > 0


def test_a_deformed_surface_is_where_the_positions_are():
    mesh = sphere(0.5, 3)
    squeezed = mesh.vertices * (1, 1, 0.5) + (0, 0, 2)
    surface = surface_mesh(mesh, squeezed)
    np.testing.assert_array_equal(surface.vertices, squeezed[mesh.surface_vertices])
    assert surface.volume == pytest.approx(mesh.volume / 2)


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply", "stl"])
def test_engines_formats_come_back_with_the_same_shape(tmp_path, suffix):
    mesh = sphere(0.5, 3)
    surface_mesh(mesh).export(tmp_path / f"ball.{suffix}")
    found = trimesh.load(tmp_path / f"ball.{suffix}", force="mesh")
    assert found.volume == pytest.approx(mesh.volume, rel=1e-5)
    assert len(found.faces) == len(mesh.surface)


def test_the_mesh_is_not_changed_through_its_surface():
    mesh = box()
    surface = surface_mesh(mesh)
    surface.vertices[:] = 0
    surface.faces[:] = 0
    assert surface_mesh(mesh).volume == pytest.approx(1)


@pytest.mark.parametrize(
    ("mesh", "positions"),
    [
        (None, None),
        (ParticleMesh(np.eye(3), [[0, 1], [1, 2]], 1.0), None),
        (box(), np.zeros((3, 3))),
        (box(), np.full((125, 3), np.nan)),
        (box(), "there"),
    ],
)
def test_what_has_no_surface_is_refused(mesh, positions):
    with pytest.raises(MeshError):
        surface_mesh(mesh, positions)
