"""Mesh files that visitors upload, and their names."""

import numpy as np
import pytest
import trimesh

from taichi_soft import box
from taichi_soft.live.uploads import require_mesh
from taichi_soft.meshing.surfaces import read_surfaces


@pytest.mark.guard
@pytest.mark.soak
@pytest.mark.parametrize(("name", "stem"), [("ball.obj", "ball3"), ("\u7bb1.obj", "mesh2")])
def test_a_name_that_another_has_gets_a_number_for_bodies_are_told_apart_by_it(tmp_path, name, stem):
    mesh = box((0.4, 0.4, 0.4), (1, 1, 1))
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.surface]
    content = "\n".join(lines).encode()
    path = require_mesh(tmp_path / "new", name, content, taken=("ball", "ball2", "mesh"))
    assert path.name == f"{stem}.obj"
    assert path.read_bytes() == content


@pytest.mark.parametrize(("up", "height", "suffix"), [(None, 0.2, ".obj"), ("z", 0.3, ".glb")])
def test_a_mesh_stands_on_the_axis_that_its_visitor_chose_wherever_it_is_read(tmp_path, up, height, suffix):
    crate = trimesh.creation.box((0.1, 0.2, 0.3))
    path = require_mesh(tmp_path / "new", "crate.obj", crate.export(file_type="obj").encode(), up=up)
    assert path.name == f"crate{suffix}"
    (found,) = read_surfaces(path)
    assert np.ptp(found.vertices[:, 2]) == pytest.approx(height, rel=1e-6)
