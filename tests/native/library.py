"""The native library through ctypes, for processes that never import Taichi: `in_process` runs one."""

import ctypes
import json
import os
import subprocess
import sys
from ctypes import byref, c_char_p, c_double, c_float, c_int32, c_size_t, c_uint32, c_uint64
from pathlib import Path

c_int64 = ctypes.c_int64
OK, ARGUMENT, HANDLE, BUSY, FILE, VERSION, SIZE, STATE, SNAPSHOT, RUNTIME = range(0, -10, -1)


class Pose(ctypes.Structure):
    """`ts_pose`."""

    _fields_ = [("position", c_double * 3), ("rotation", c_double * 4)]


class Placement(ctypes.Structure):
    """`ts_placement`."""

    _fields_ = [
        ("struct_size", c_uint32),
        ("reserved", c_int32),
        ("position", c_double * 3),
        ("rotation", c_double * 4),
        ("velocity", c_double * 3),
        ("spin", c_double * 3),
    ]


class Library:
    """The library's calls.

    They return their results or raise `Refused`; `raw` has the functions themselves.
    """

    def __init__(self, folder):
        self.raw = ctypes.CDLL(str(Path(folder) / "libtaichi_soft.so"))
        self.raw.ts_last_error.restype = c_char_p

    def call(self, name, *arguments):
        code = getattr(self.raw, name)(*arguments)
        if code != OK:
            raise RefusedError(code, self.raw.ts_last_error().decode())

    def load(self, folder):
        scene = c_uint64()
        self.call("ts_scene_load", str(folder).encode(), byref(scene))
        return scene

    def create(self, scene):
        world = c_uint64()
        self.call("ts_world_create", scene, byref(world))
        return world

    def step(self, world, dt=1 / 64, substeps=0):
        self.call("ts_world_step", world, c_double(dt), c_int32(substeps))

    def hash(self, world):
        found = c_uint64()
        self.call("ts_world_hash", world, byref(found))
        return found.value

    def body(self, world, slot):
        found = c_uint64()
        self.call("ts_world_get_body", world, c_int32(slot), byref(found))
        return found

    def positions(self, world, body, count, alpha=1.0):
        rows = (c_float * (3 * count))()
        self.call("ts_body_positions", world, body, c_double(alpha), rows, c_size_t(3 * count))
        return [list(rows[3 * i : 3 * i + 3]) for i in range(count)]

    def snapshot(self, world):
        size = c_size_t()
        self.call("ts_world_snapshot", world, None, c_size_t(0), byref(size))
        buffer = (ctypes.c_char * size.value)()
        self.call("ts_world_snapshot", world, buffer, size, byref(size))
        return bytes(buffer)

    def restore(self, world, data):
        self.call("ts_world_restore", world, data, c_size_t(len(data)))


class RefusedError(Exception):
    """A call that returned an error."""

    def __init__(self, code, text):
        super().__init__(f"{code}: {text}")
        self.code, self.text = code, text


def vector(*numbers):
    return (c_double * len(numbers))(*numbers)


def in_process(native, code, *arguments):
    """Run code in a process of its own, with `soft` the library and `arguments` a list of texts.

    Returns: what it prints as JSON in its last line.
    """
    head = "import json, sys\nfrom library import *\nsoft, arguments = Library(sys.argv[1]), sys.argv[2:]\n"
    done = subprocess.run(
        [sys.executable, "-c", head + code, str(native), *map(str, arguments)],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout.splitlines()[-1])


__all__ = [
    *("ARGUMENT", "BUSY", "FILE", "HANDLE", "OK", "RUNTIME", "SIZE", "SNAPSHOT", "STATE", "VERSION"),
    *("Library", "Placement", "Pose", "RefusedError", "byref", "c_double", "c_float", "c_int32", "c_int64"),
    *("c_size_t", "c_uint32", "c_uint64", "in_process", "vector"),
]
