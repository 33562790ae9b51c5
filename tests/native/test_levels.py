"""Levels of detail in C: obstacles to a change, preserved state, and invalid world files."""

import shutil

import numpy as np
import pytest
from library import ARGUMENT, FILE, STATE, in_process
from test_forged import LOADED, changed, first, read

from taichi_soft.export.archive import written

pytestmark = pytest.mark.soak

REFUSED = """
scene = soft.load(arguments[0])
world = soft.create(scene)
found, are_same = {}, True

def refused(what, name, *call):
    global are_same
    before = soft.hash(world), soft.snapshot(world)
    code = getattr(soft.raw, name)(world, *call)
    found[what] = [code, soft.raw.ts_last_error().decode()]
    are_same = are_same and before == (soft.hash(world), soft.snapshot(world))

def set_level(what, body, level, release=0):
    refused(what, "ts_body_set_level", body, c_int32(level), c_int32(release))

def numbers(*those):
    return (c_int32 * len(those))(*those), c_size_t(len(those))

def level_of(body):
    level, count = c_int32(), c_int32()
    soft.call("ts_body_get_level", world, body, byref(level))
    soft.call("ts_body_get_vertex_count", world, body, byref(count))
    return level.value, count.value

ball, bar, held = (soft.body(world, slot) for slot in (0, 3, 6))
set_level("below", bar, -1)
set_level("beyond", bar, 3)
count, made, frame = c_int32(), c_uint64(), c_int32()
soft.call("ts_asset_get_level_count", scene, c_int32(1), byref(count))
soft.call("ts_body_join", world, bar, *numbers(0, 1), ball, numbers(2, 3)[0], byref(made))
set_level("joined", bar, 1)
set_level("joined from the other side", ball, 1)
soft.call("ts_body_set_level", world, bar, c_int32(1), c_int32(1))
soft.call("ts_world_get_joint", world, c_int32(0), byref(made))
joint = made.value
rows = (c_float * 300000)()
refused("positions", "ts_body_positions", bar, c_double(1.0), rows, c_size_t(3 * 108))
refused("mesh", "ts_body_mesh", bar, c_int32(1), rows, rows, c_size_t(3))
pose = Pose((c_double * 3)(0, 0, 9), (c_double * 4)(0, 0, 0, 1))
soft.call("ts_frame_add", world, byref(pose), byref(frame))
soft.call("ts_body_attach", world, held, *numbers(int(arguments[1])), frame, c_int32(0))
set_level("homeless", held, 2)
soft.call("ts_body_set_level", world, held, c_int32(2), c_int32(1))
loose = soft.raw.ts_body_detach(world, held, None, c_size_t(0))
levels = [level_of(body) for body in (ball, bar, held)]
soft.call("ts_body_set_velocity", world, bar, vector(1.9e4, 0, 0), vector(0, 0, 0))
place = vector(9.9999e6, 0, 5), vector(0, 0, 0, 1)
soft.call("ts_body_teleport", world, bar, *place, c_int32(0))
soft.call("ts_body_set_velocity", world, bar, vector(1.9e4, 0, 0), vector(0, 0, 0))
soft.step(world)
set_level("frozen", bar, 0)
print(json.dumps([found, are_same, count.value, joint, levels]))
"""

WANTED = {
    "below": (ARGUMENT, "level is -1, and asset 1 has 3: give 0 to 2"),
    "beyond": (ARGUMENT, "level is 3, and asset 1 has 3: give 0 to 2"),
    "joined": (STATE, "has joints on its vertices"),
    "joined from the other side": (STATE, "release = 1"),
    "positions": (-6, "give room for 162"),
    "mesh": (STATE, "mesh 1 is for level 0, the body is at level 1"),
    "homeless": (STATE, "would hold nothing at level 2"),
    "frozen": (STATE, "is frozen"),
}


def test_what_bars_a_change_is_refused_with_a_way_out_and_changes_nothing(native, export):
    folder = export("levels")
    arrays = read(folder / "world.tsw")
    finest = arrays["asset2/vertices"]
    # Beside the pinned end: what is pinned is nearer to all that the coarsest bar has there.
    beside = np.flatnonzero(np.isclose(finest[:, 0], np.unique(finest[:, 0].round(9))[1]))
    found, are_same, count, joint, levels = in_process(native, REFUSED, folder, beside[0])
    assert found.keys() == WANTED.keys()
    for what, (code, text) in WANTED.items():
        assert found[what][0] == code, (what, found[what])
        assert text in found[what][1], (what, found[what])
    assert are_same
    assert count == 3
    assert joint == 0  # the change released it
    assert levels == [[0, levels[0][1]], [1, 54], [2, 16]]


def second(array):
    return np.roll(array, 1)


FORGERIES = {
    "a vertex that there is not": changed("asset0/level1/slot/tet_vertices", first(2**20)),
    "an edge that there is not": changed("asset1/level1/slot/tet_edges", first(-1)),
    "edges beyond the last": changed("asset1/level2/slot/edge_blocks", lambda array: array + 1000),
    "more tetrahedra than the finest has": changed(
        "asset1/level1/slot/tet_vertices", lambda array: np.tile(array, 9)
    ),
    "constants that are cut off": changed("asset1/level1/constants/tet_lame", lambda array: array[:-1]),
    "points of a hull without a place": changed("asset0/level2/touching/outer", first(2**20)),
    "a passage from a vertex that there is not": changed("asset0/passage0-1/sources", first(2**20)),
    "a passage that begins behind itself": changed("asset0/passage1-2/begins", second),
    "a level that there is not": changed("levels/level", first(3)),
    "pins that stand for no vertex": changed("levels/held_counts", first(1)),
    "more levels than the file has": changed("levels/counts", lambda array: array + 1),
    "a mesh of a level that there is not": changed("mesh1/kind", first(9)),
}


@pytest.mark.parametrize("what", FORGERIES)
def test_a_world_file_whose_levels_are_not_in_order_is_refused(what, native, export, tmp_path):
    folder = shutil.copytree(export("levels"), tmp_path / "forged")
    arrays = read(folder / "world.tsw")
    FORGERIES[what](arrays)
    (folder / "world.tsw").write_bytes(written(arrays))
    assert in_process(native, LOADED, folder) in (FILE, -5)
