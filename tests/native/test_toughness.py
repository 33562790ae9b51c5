"""Any misuse of the native library gives an error, and leaves the state unchanged."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from library import FILE, HANDLE, VERSION, in_process
from native_build import build

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def heap(export):
    return export("heap")


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """Folder of the library, built to look for faults of memory and undefined behaviour."""
    options = "-DTAICHI_SOFT_SANITIZE=ON", "-DCMAKE_BUILD_TYPE=RelWithDebInfo"
    return build(tmp_path_factory.mktemp("checked"), *options)


@pytest.mark.parametrize(("name", "seconds"), [("heap", "60"), ("levels", "40")])
def test_calls_at_random_end_in_errors_and_change_nothing_that_they_do_not_return(
    name, seconds, checked, export
):
    """By hand, run the test for ten minutes with other seeds."""
    done = subprocess.run([checked / "fuzz", export(name), seconds, "1"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    calls, refused = (int(text) for text in done.stdout.split() if text.isdigit())
    assert 0.2 < refused / calls < 0.95


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs valgrind")
def test_loading_what_is_damaged_reads_no_memory_that_is_not_there(native, heap, tmp_path):
    """Under valgrind, which does not look into what Taichi compiles: no kernel runs here."""
    for cut in (0, 20, 40, 3000):
        bad = tmp_path / f"cut{cut}"
        shutil.copytree(heap, bad)
        whole = (bad / "world.tsw").read_bytes()
        (bad / "world.tsw").write_bytes(whole[:cut])
        command = ["valgrind", "-q", "--error-exitcode=9", native / "play", bad]
        done = subprocess.run(command, input="", capture_output=True, text=True)
        assert done.returncode == 1, done.stderr
        assert "error -4" in done.stderr


DAMAGE = """
import random, shutil
from pathlib import Path
source, copy = Path(arguments[0]), Path(arguments[1])
shutil.copytree(source, copy)
opened = "linux-x64-v3.so" if " avx2 " in Path("/proc/cpuinfo").read_text() else "linux-x64.so"
files = [copy / "kernels" / opened, copy / "world.tsw"]
rng, found = random.Random(3), []
for trial in range(200):
    path = copy / "world.tsw" if trial % 2 else rng.choice(files)
    whole = path.read_bytes()
    at = rng.randrange(len(whole) if trial % 8 else min(len(whole), 40))
    flipped = bytes([whole[at] ^ 1 << rng.randrange(8)])
    damaged = whole[:at] if trial % 3 == 0 else whole[:at] + flipped + whole[at + 1 :]
    path.write_bytes(damaged)
    try:
        soft.load(copy)
        found.append([path.name, at, trial % 3, 0])
    except RefusedError as refused:
        found.append([path.name, at, trial % 3, refused.code])
    path.write_bytes(whole)
soft.load(copy)
print(json.dumps(found))
"""


def test_a_world_file_that_is_damaged_anywhere_is_refused(native, heap, tmp_path):
    found = in_process(native, DAMAGE, heap, tmp_path / "copy")
    assert len(found) == 200
    taken = [each for each in found if each[3] not in (FILE, VERSION)]
    assert taken == []


LOADED = """
try:
    world = soft.create(soft.load(arguments[0]))
    for _ in range(30):
        soft.step(world)
    print(json.dumps([0, str(soft.hash(world))]))
except RefusedError as refused:
    print(json.dumps([refused.code, refused.text]))
"""


def test_a_game_ships_either_file_for_its_processor_and_is_told_where_both_are_missing(
    native, heap, tmp_path
):
    whole, copy = in_process(native, LOADED, heap), shutil.copytree(heap, tmp_path / "copy")
    assert whole[0] == 0
    (copy / "kernels" / "linux-x64-v3.so").unlink()
    assert in_process(native, LOADED, copy) == whole
    (copy / "kernels" / "linux-x64.so").unlink()
    code, text = in_process(native, LOADED, copy)
    assert code == FILE
    assert text.endswith(
        "linux-x64.so, which belongs to the world file: copy it there, or export the world again"
    )


@pytest.mark.parametrize(
    ("options", "way_out"),
    [
        (["--for", "linux-arm64"], "but linux-arm64.so: export it again, with --for linux-x64"),
        (["--static"], "linux-x64-v3.o: call ts_scene_load_linked, or export it again without --static"),
    ],
)
def test_a_world_for_another_machine_is_refused_with_the_way_out(options, way_out, native, export):
    code, text = in_process(native, LOADED, export("heap", *options))
    assert code == FILE
    assert text.endswith(way_out)


NAMED = """
from ctypes import byref, c_int32
scene, found = soft.load(arguments[0]), []
for kind in (0, 3):
    try:
        soft.call("ts_scene_find", scene, c_int32(kind), b"nobody", byref(c_int32()))
    except RefusedError as refused:
        found.append(refused.text)
print(json.dumps(found))
"""


def test_a_wrong_name_is_refused_with_those_that_there_are(native, heap):
    among_bodies, among_frames = in_process(native, NAMED, heap)
    names = ", ".join(f"body{i}" for i in range(10))
    assert among_bodies == f"unknown name nobody: give one of {names}"
    assert among_frames == "unknown name nobody: the world file has none of that kind"


GROWTH = """
import resource
def used():
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()
scene = soft.load(arguments[0])
before = 0
for i in range(10_000):
    world = soft.create(scene)
    if i % 100 == 0:
        soft.step(world)
        first = soft.hash(world)
    soft.call("ts_world_destroy", world)
    if i == 500:
        before = used()
print(json.dumps([used() - before, first]))
"""


def test_ten_thousand_worlds_come_and_go_and_memory_does_not_grow(native, heap):
    grown, _ = in_process(native, GROWTH, heap)
    assert grown < 20e6  # [bytes]; the image of one is 3 MB


TWO = """
import threading
scene = soft.load(arguments[0])
alone = soft.create(scene)
for _ in range(200):
    soft.step(alone)
expected = soft.hash(alone)
worlds = [soft.create(scene) for _ in range(2)]
def play(world):
    for _ in range(200):
        soft.step(world)
threads = [threading.Thread(target=play, args=(world,)) for world in worlds]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
soft.call("ts_scene_unload", scene)  # worlds go on
print(json.dumps([expected, *map(soft.hash, worlds)]))
"""


def test_two_worlds_in_two_threads_have_the_bits_of_one_alone(native, heap):
    expected, *found = in_process(native, TWO, heap)
    assert found == [expected, expected]


BUSY_WORLD = """
import threading
scene = soft.load(arguments[0])
world, codes = soft.create(scene), []
def play():
    for _ in range(300):
        codes.append(soft.raw.ts_world_step(world, c_double(1 / 64), c_int32(0)))
threads = [threading.Thread(target=play) for _ in range(3)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
made = sum(code == OK for code in codes)
other = soft.create(scene)
for _ in range(made):
    soft.step(other)
print(json.dumps([sorted(set(codes)), made, soft.hash(world) == soft.hash(other)]))
"""


def test_a_world_in_use_refuses_other_threads_and_makes_whole_steps(native, heap):
    codes, made, is_same = in_process(native, BUSY_WORLD, heap)
    assert codes in ([-3, 0], [0])
    assert 0 < made <= 900
    assert is_same


GONE = """
scene = soft.load(arguments[0])
world = soft.create(scene)
body = soft.body(world, 0)
soft.call("ts_world_despawn", world, body)
found = []
def refused(name, *call):
    found.append(getattr(soft.raw, name)(*call))
status = c_int32()
refused("ts_body_get_status", world, body, byref(status))
soft.call("ts_world_destroy", world)
refused("ts_world_step", world, c_double(0.01), c_int32(1))
refused("ts_world_destroy", world)
again = soft.create(scene)
refused("ts_world_step", world, c_double(0.01), c_int32(1))
soft.call("ts_scene_unload", scene)
refused("ts_world_create", scene, byref(c_uint64()))
refused("ts_scene_unload", scene)
soft.step(again)
print(json.dumps(found))
"""


def test_what_is_gone_is_refused_by_its_handle(native, heap):
    assert in_process(native, GONE, heap) == [HANDLE] * 6


FOREIGN = """
worlds = [soft.create(soft.load(folder)) for folder in arguments]
snapshots, found = [soft.snapshot(world) for world in worlds], []
for world in worlds:
    soft.step(world)
before = [soft.hash(world) for world in worlds]
for world, snapshot in ((worlds[0], snapshots[1]), (worlds[1], snapshots[0]), (worlds[0], b"x" * 50)):
    found.append(soft.raw.ts_world_restore(world, snapshot, c_size_t(len(snapshot))))
print(json.dumps([found, before == [soft.hash(world) for world in worlds]]))
"""


def test_a_snapshot_of_another_world_is_refused(native, heap, export):
    codes, is_same = in_process(native, FOREIGN, heap, export("free"))
    assert codes == [-8, -8, -8]
    assert is_same


AXES = {
    "y-up": (np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), 1.0),
    "unity": (np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0]]), 1.0),
    "unreal": (np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1]]), 100.0),
}
"""Axes of the engines in ours, as their manuals draw them, and metres in their unit."""

HOSTED = """
rows, scale, turn = json.loads(arguments[1]), float(arguments[2]), json.loads(arguments[3])
scene = soft.load(arguments[0])
world = soft.create(scene)
def out(v, unit):
    return [unit * sum(row[k] * v[k] for k in range(3)) for row in rows]
pose = Pose((c_double * 3)(*out((0.1, -0.2, 0.45), scale)), (c_double * 4)(*turn))
soft.call("ts_collider_move_to", world, c_int32(0), byref(pose))
soft.call("ts_world_set_gravity", world, vector(*out((0.2, -0.1, -9.0), scale)))
body = soft.body(world, 1)
soft.call("ts_body_apply_impulse", world, body, vector(*out((3.0, 2.0, 5.0), scale)), None, c_size_t(0))
for _ in range(60):
    soft.step(world)
impulse, moment = vector(0, 0, 0), vector(0, 0, 0)
soft.call("ts_collider_get_impulse", world, c_int32(3), impulse, moment)
center = vector(0, 0, 0)
soft.call("ts_body_center", world, body, center)
soft.call("ts_collider_get_pose", world, c_int32(0), byref(pose))
read = impulse, moment, center, pose.position, pose.rotation
print(json.dumps([soft.hash(world), *map(list, read)]))
"""


def test_each_engine_gets_its_axes_and_the_bodies_move_alike(native, heap, export):
    """The same push in the engine's axes and unit gives the same motion; all that is read is turned so."""
    axis, angle = np.array([0.36, 0.48, 0.8]), 0.7
    ours = [*(np.sin(angle / 2) * axis), np.cos(angle / 2)]
    expected = in_process(native, HOSTED, heap, json.dumps(np.eye(3).tolist()), 1.0, json.dumps(ours))
    for name, (rows, scale) in AXES.items():
        handedness = np.linalg.det(rows)
        turn = [*(np.sin(angle / 2) * handedness * (rows @ axis)), np.cos(angle / 2)]
        folder = export("heap", "--axes", name)
        found = in_process(native, HOSTED, folder, json.dumps(rows.tolist()), scale, json.dumps(turn))
        np.testing.assert_allclose(found[1], scale * rows @ expected[1], rtol=1e-3, atol=1e-3 * scale)
        np.testing.assert_allclose(
            found[2], scale**2 * handedness * rows @ expected[2], rtol=1e-2, atol=1e-2 * scale**2
        )
        np.testing.assert_allclose(found[3], scale * rows @ expected[3], atol=1e-5 * scale)
        np.testing.assert_allclose(found[4], scale * rows @ expected[4], atol=1e-6 * scale)
        np.testing.assert_allclose(found[5][:3], handedness * rows @ expected[5][:3], atol=1e-6)
        np.testing.assert_allclose(found[5][3], expected[5][3], atol=1e-6)


def test_the_library_needs_nothing_beside_it(native, heap, tmp_path):
    for name in ("libtaichi_soft.so", "play"):
        shutil.copy(native / name, tmp_path / name)
    done = subprocess.run(
        [tmp_path / "play", heap], input="step 0.01 4\n", capture_output=True, text=True, cwd="/"
    )
    assert done.returncode == 0, done.stderr
    needed = subprocess.run(["ldd", tmp_path / "libtaichi_soft.so"], capture_output=True, text=True).stdout
    assert "taichi_c_api" not in needed
