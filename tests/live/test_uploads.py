"""Mesh files that visitors bring, and what they are called."""

import pytest

from taichi_soft import box
from taichi_soft.live.uploads import require_mesh


@pytest.mark.parametrize(("name", "stem"), [("ball.obj", "ball3"), ("\u7bb1.obj", "mesh2")])
def test_a_name_that_another_has_gets_a_number_for_bodies_are_told_apart_by_it(tmp_path, name, stem):
    mesh = box((0.4, 0.4, 0.4), (1, 1, 1))
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.surface]
    content = "\n".join(lines).encode()
    path = require_mesh(tmp_path / "new", name, content, taken=("ball", "ball2", "mesh"))
    assert path.name == f"{stem}.obj"
    assert path.read_bytes() == content
