"""Snapshots and world files with correct checksums and wrong numbers: they are refused, or harmless."""

import shutil
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from library import in_process
from native_build import ROOT

from taichi_soft.export.archive import TYPES, written

pytestmark = pytest.mark.soak

FORGED = """
import random, struct, zlib
scene = soft.load(arguments[0])
world = soft.create(scene)
soft.call("ts_world_record_events", world, c_int32(31))
for _ in range(60):
    soft.step(world)
whole, rng, codes = soft.snapshot(world), random.Random(5), []
odd = [struct.pack("<i", 3 + 2**28), struct.pack("<i", -7), struct.pack("<f", float("nan")), b"\\xff" * 4]
for trial in range(400):
    data = bytearray(whole)
    at = 24 + 4 * rng.randrange((len(data) - 28) // 4)  # all but what says what it is, and its sum
    data[at : at + 4] = odd[trial % 4]
    data[20:24] = bytes(4)
    data[20:24] = struct.pack("<I", zlib.crc32(data))
    before = soft.hash(world)
    codes.append(soft.raw.ts_world_restore(world, bytes(data), c_size_t(len(data))))
    if codes[-1] == OK:
        soft.step(world)
    elif soft.hash(world) != before:
        raise SystemExit("a refused snapshot has changed the world")
    soft.restore(world, whole)
print(json.dumps(codes))
"""


@pytest.mark.parametrize("name", ["heap", "free", "held", "joined", "levels"])
def test_a_forged_snapshot_is_refused_or_ends_no_process(name, native, export):
    codes = in_process(native, FORGED, export(name))
    assert set(codes) == {0, -8}
    assert codes.count(-8) > 50


def read(path):
    """Return the arrays of a world file."""
    data, arrays = path.read_bytes(), {}
    kinds, at = {code: kind for kind, code in TYPES.items()}, 32
    for _ in range(struct.unpack_from("<I", data, 12)[0]):
        length, code, dimensions, _ = struct.unpack_from("<IIII", data, at)
        sizes = struct.unpack_from(f"<{dimensions}Q", data, at + 16)
        at += 16 + 8 * dimensions
        name = data[at : at + length].decode()
        at += -(-length // 8) * 8
        count = int(np.prod(sizes))
        arrays[name] = np.frombuffer(data, kinds[code], count, at).reshape(sizes).copy()
        at += -(-count * kinds[code].itemsize // 8) * 8
    return arrays


def test_a_world_file_is_read_as_it_was_written(export):
    path = export("heap") / "world.tsw"
    assert written(read(path)) == path.read_bytes()
    assert struct.unpack_from("<I", path.read_bytes(), 24)[0] == zlib.crc32(path.read_bytes()[32:])


def changed(name, change):
    def forge(arrays):
        arrays[name] = change(arrays[name])

    return forge


def first(value):
    def change(array):
        array.reshape(-1)[:16] = value
        return array

    return change


def added(*numbers):
    return lambda array: np.add(array, numbers).astype(array.dtype)


def held_by_a_body_that_there_is_not(arrays):
    names = bytes(arrays["fields/names"]).decode().split("\0")
    place = arrays["fields/places"][names.index("grabs.body")][0]
    arrays["fields/image"][place : place + 4] = np.frombuffer(struct.pack("<i", 10**6), dtype=np.uint8)


def unnamed(arrays):
    arrays["names/frame"] = np.frombuffer(b"x\0" * 200_000, dtype=np.uint8)


FORGERIES = {
    "a table that names what there is not": changed("mesh0/ints0", first(2**28)),
    "a table that is cut off": changed("mesh0/ints0", lambda array: array[:8]),
    "more particles than fields have": changed(
        "world/counts", lambda array: np.add(array, (0, 2**20)).astype(np.int32)
    ),
    "a slot behind the last particle": changed("slots/begin", lambda array: array + 2**20),
    "frames without a pose": unnamed,
    "a field beyond the image": changed("fields/places", added(2**24, 0, 0, 0, 0)),
    "names without an end": changed("names/asset", lambda array: array[:-1]),
    "no number of limits": changed("world/limits", lambda array: array[:3]),
    "a collider without a pose": changed("colliders/pose", lambda array: array[:-1]),
    "ranks that are none": changed("asset0/rank", first(-1)),
    "fewer rows than can touch": changed("events/limits", lambda array: np.append(array[:2], 1.0)),
    "a grab of a body that there is not": held_by_a_body_that_there_is_not,
    "grabs without a size": changed("grabs/patch_limits", first(np.nan)),
    "grabs with more rows than fields have": changed("grabs/limits", added(0, 0, 1000)),
    "vertices that are nowhere": changed("asset0/vertices", first(np.nan)),
}

LOADED = """
code = soft.raw.ts_scene_load(arguments[0].encode(), byref(scene := c_uint64()))
if code == OK:  # what a scene has no use for is looked at with the first world
    world = c_uint64()
    code = soft.raw.ts_world_create(scene, byref(world))
print(json.dumps(code))
"""


@pytest.mark.parametrize("what", FORGERIES)
def test_a_world_file_whose_numbers_are_not_in_order_is_refused(what, native, export, tmp_path):
    folder = shutil.copytree(export("heap"), tmp_path / "forged")
    arrays = read(folder / "world.tsw")
    FORGERIES[what](arrays)
    (folder / "world.tsw").write_bytes(written(arrays))
    assert in_process(native, LOADED, folder) == -4


def test_the_headers_of_the_library_are_those_that_follow_from_the_declarations_of_fields(monkeypatch):
    monkeypatch.syspath_prepend(Path(ROOT) / "engine_adapter" / "native")
    from write_fields import SOURCES, headers

    assert {name: (SOURCES / name).read_text() for name in headers()} == headers()
