"""`taichi-soft bake` as a user runs it."""

import json
import subprocess
import sys

import numpy as np
import pytest

pytestmark = pytest.mark.soak

SCENE = """
from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Material, SpringMaterial, World, box, rope


def make_world(**options):
    world = World(**options)
    world.add_body(box((1, 1, 1), cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0), position=(0, 0, 1))
    return world


def with_a_rope():
    world = make_world(soft_contact=False)
    world.add_body(rope(1.0, 4, 0.2), SpringMaterial(1000.0, 1.0), position=(0, 3, 1))
    return world


def make_game():
    world = make_world()
    world.build()
    push = lambda world: world.bodies[0].apply_impulse((10.0, 0.0, 0.0))
    return EngineAdapter(world, FixedStep(1 / 50), before_step=push)


def nothing():
    return None
"""


def bake(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "taichi_soft", "bake", *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        timeout=300,
    )


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "scene.py").write_text(SCENE)
    return tmp_path


@pytest.mark.guard
def test_a_scene_becomes_a_file_and_its_size_is_told_first(folder):
    done = bake(
        folder, "scene.py:make_world", "--out", "out/a.glb", "--seconds", "0.2", "--fps", "10", "--step"
    )
    assert done.returncode == 0, done.stderr
    first, last = done.stdout.splitlines()
    assert first.startswith("3 frames of 54 vertices, about 0.0 MB")
    assert last.startswith("wrote out/a.glb: 3 frames at 10 per second, 1 mesh, ")
    data = (folder / "out/a.glb").read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert tree["animations"][0]["samplers"][0]["interpolation"] == "STEP"
    assert [each.name for each in (folder / "out").iterdir()] == ["a.glb"]


def test_an_adapter_makes_its_own_steps_with_what_comes_before_them(folder):
    done = bake(folder, "scene.py:make_game", "--out", "a.npz", "--seconds", "0.2", "--fps", "25")
    assert done.returncode == 0, done.stderr
    cache = np.load(folder / "a.npz")
    middle = cache["positions"][:, :, 0].mean(axis=1)
    assert len(middle) == 6
    # An impulse of 10 Ns on 1,000 kg before each of the two steps of a frame: n steps move it n (n + 1) / 2
    # times 0.01 m/s in 0.02 s. It has not come down yet.
    steps = 2 * np.arange(6)
    np.testing.assert_allclose(middle - middle[0], 0.01 * 0.02 * steps * (steps + 1) / 2, atol=2e-4)


def test_what_has_no_triangles_is_left_out_and_named(folder):
    done = bake(folder, "scene.py:with_a_rope", "--out", "a.npz", "--seconds", "0.1")
    assert done.returncode == 0, done.stderr
    assert "body 1 has no triangles and was skipped" in done.stdout
    assert np.load(folder / "a.npz")["names"].tolist() == ["body_0"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (("scene.py", "--out", "a.glb"), "which scene, must be like game.py:make_world, got 'scene.py'"),
        (("scene.py:nowhere", "--out", "a.glb"), "has no function 'nowhere'"),
        (("scene.py:nothing", "--out", "a.glb"), "must return a World or an EngineAdapter, got None"),
        (("scene.py:make_world", "--out", "a.abc"), ".glb, .npz, .vat, .usdc"),
        (("scene.py:make_world", "--out", "a.glb", "--limit", "0.001"), "limit of 0.001 MB"),
        (("scene.py:make_world", "--out", "/proc/nowhere/a.npz"), "cannot write /proc/nowhere/a.npz"),
    ],
)
def test_what_cannot_be_baked_is_one_line_and_leaves_nothing(folder, arguments, reason):
    done = bake(folder, *arguments, "--seconds", "0.1")
    assert done.returncode == 1
    assert reason in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert {each.name for each in folder.iterdir()} <= {"scene.py", "__pycache__"}
