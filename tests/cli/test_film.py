"""`taichi-soft film` as a user runs it."""

import subprocess
import sys

import cv2
import numpy as np
import pytest
import trimesh

pytestmark = pytest.mark.soak

SCENE = """
from engine_adapter import FixedStep
from taichi_soft import BoxShape, Material, World, box
from taichi_soft.render.film import Follow, Stage


def make_world():
    world = World(floor=None)
    world.add_body(box((1, 1, 1), (2, 2, 2)), Material(1e5, 0.2, 1000.0), position=(0, 0, 1))
    return world


def make_stage():
    world = make_world()
    world.build()
    return Stage.of(world, seconds=0.2, step=FixedStep(1 / 50))


def make_moving_stage():
    stage = make_stage()
    stage.camera = Follow(stage.actors[0].body, stage.camera)
    return stage


def nothing():
    return None
"""
SMALL = ("--size", "128x96", "--fps", "20")


def film(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "taichi_soft", "film", *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        timeout=300,
    )


@pytest.fixture
def folder(tmp_path):
    """Return a folder with scripts, and an .obj file without a unit: a box of 40 x 20 x 30."""
    (tmp_path / "scenes.py").write_text(SCENE)
    (tmp_path / "world.py").write_text(f"{SCENE}\nworld = make_world()\n")
    (tmp_path / "stage.py").write_text(f"{SCENE}\nstage = make_stage()\nworld = stage.world\n")
    (tmp_path / "two.py").write_text(f"{SCENE}\none, other = make_world(), make_world()\n")
    trimesh.creation.box((40.0, 20.0, 30.0)).export(tmp_path / "box.obj")
    return tmp_path


def rows_of_body(picture):
    """Return the image rows that contain pixels much redder than blue, as the first colour of bodies is."""
    blue, _, red = np.moveaxis(picture.astype(int), 2, 0)
    return np.flatnonzero((red - blue > 60).any(axis=1))


@pytest.mark.guard
def test_a_mesh_file_is_filmed_as_it_falls_onto_the_floor_and_stays_in_the_picture(folder):
    done = film(folder, "box.obj", "--seconds", "1", "--out", "box.png", "--orbit", *SMALL)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines[0].startswith("box.obj is 40 m long in its file and is scaled to 1 m: --length ")
    assert lines[1] == "filming box"
    assert lines[2] == "wrote box.png: 20 frames, 1.0 s"
    pictures = [cv2.imread(str(file)) for file in sorted(folder.glob("box_*.png"))]
    assert len(pictures) == 20
    rows = [rows_of_body(picture) for picture in pictures]
    assert all(len(each) > 10 and each.min() > 0 and each.max() < 95 for each in rows)
    heights = np.array([each.max() for each in rows])  # of the lowest point: pixels from the top
    assert (np.diff(heights[:6]) > 0).all()  # sqrt(2 0.375 m / g) = 0.28 s
    assert heights[6] - heights[0] > 10


@pytest.mark.parametrize(
    ("scene", "name", "frames"),
    [
        ("scenes.py:make_world", "scenes", 4),
        ("world.py", "world", 4),
        ("scenes.py:make_stage", "scenes", 4),
        ("stage.py", "stage", 4),
        ("scenes:make_moving_stage", "scenes", 4),
    ],
)
def test_a_world_or_a_stage_of_a_script_or_function_is_filmed(folder, scene, name, frames):
    length = () if "stage" in scene else ("--seconds", "0.2")
    done = film(folder, scene, *length, *SMALL)
    assert done.returncode == 0, done.stderr
    found = cv2.VideoCapture(str(folder / "out" / f"{name}.mp4"))
    assert int(found.get(cv2.CAP_PROP_FRAME_COUNT)) == frames
    assert f"{name}: 0.1" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("jelly",), "cannot film 'jelly': it is a demo: taichi-soft demo jelly"),
        (("duck",), "name a mesh file (.stl, .obj"),
        (("nowhere.glb",), "nowhere.glb: cannot be read (no such file)"),
        (("nowhere.py",), "cannot read nowhere.py: No such file"),
        (("two.py",), "two.py must have exactly one global World or Stage, found 2"),
        (("scenes.py",), "found 0"),
        (("scenes.py:nothing",), "scenes.py:nothing must return a World or a Stage, got None"),
        (("world.py", "--material", "foam"), "--material is for mesh files, and world.py is a scene"),
        (("scenes.py:make_moving_stage", "--orbit"), "--orbit needs a fixed camera"),
        (("box.obj", "--material", "jam"), "unknown material 'jam'"),
        (("box.obj", "--length", "0"), "length must be a number above 0 m"),
        (("box.obj", "--seconds", "0", "--orbit"), "seconds must be a number above 0 s"),
        (("box.obj", "--size", "9"), "size must be width x height"),
    ],
)
def test_a_wrong_argument_gives_one_line_and_no_film(folder, arguments, said):
    done = film(folder, *arguments)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert said in line
    assert not list(folder.rglob("*.mp4"))
