"""Joints, motors, gravity and friction in C: refused calls, and objects of the original script."""

import subprocess
import sys

import pytest
from library import ARGUMENT, HANDLE, STATE, in_process

pytestmark = pytest.mark.soak

REFUSED = """
import ctypes
class Drive(ctypes.Structure):
    _fields_ = [("struct_size", c_uint32)]
    _fields_ += [(name, c_int32) for name in ("turns", "is_fixed", "has_point")]
    _fields_ += [("axis", c_double * 3), ("point", c_double * 3), ("speed", c_double), ("limit", c_double)]

class Shape(ctypes.Structure):
    _fields_ = [("struct_size", c_uint32), ("kind", c_int32), ("size", c_double * 3)]
    _fields_ += [(name, c_double) for name in ("friction", "restitution", "thickness")]
    _fields_ += [("group", c_int32), ("mask", c_int32)]

joined, tilted = (soft.create(soft.load(folder)) for folder in arguments)
found, are_same = {}, True

def refused(what, world, name, *call):
    global are_same
    before = soft.hash(world), soft.snapshot(world)
    code = getattr(soft.raw, name)(world, *call)
    found[what] = [code, soft.raw.ts_last_error().decode()]
    are_same = are_same and before == (soft.hash(world), soft.snapshot(world))

def drive(axis=(0, 0, 1), turns=1, is_fixed=0, has_point=0, speed=1.0, limit=1.0):
    kind = ctypes.sizeof(Drive), turns, is_fixed, has_point
    return byref(Drive(*kind, vector(*axis), vector(0, 0, 0), speed, limit))

def numbers(*those):
    return (c_int32 * len(those))(*those), c_size_t(len(those))

made = c_uint64()
body, other, lonely = (soft.body(joined, slot) for slot in (5, 7, 0))
refused("gravity", joined, "ts_world_set_gravity", vector(0, 0, -1e8))
refused("friction", joined, "ts_body_set_friction", body, c_double(-0.1))
refused("friction of a collider", joined, "ts_collider_set_friction", c_int32(7), c_double(0.1))
refused("friction between", tilted, "ts_body_set_friction", soft.body(tilted, 0), c_double(0.1))
refused("itself", joined, "ts_body_join", body, *numbers(0), body, None, byref(made))
refused("far", joined, "ts_body_join", body, *numbers(0), lonely, None, byref(made))
refused("twice", joined, "ts_body_join", body, *numbers(0, 0), lonely, numbers(1, 2)[0], byref(made))
refused("axis", joined, "ts_body_add_motor", body, *numbers(0, 1, 2), drive(axis=(0, 0, 0)), byref(made))
refused("line", joined, "ts_body_add_motor", body, *numbers(0, 1), drive(), byref(made))
refused("point", joined, "ts_body_add_motor", body, *numbers(0, 1, 2), drive(has_point=1), byref(made))
refused("limit", joined, "ts_body_add_motor", body, *numbers(0, 1, 2), drive(limit=-1.0), byref(made))
grid = Shape(ctypes.sizeof(Shape), 4, vector(1, 1, 1), 0.5, -1.0, 0.0, 1, -1)
upright = Pose((c_double * 3)(0, 0, 9), (c_double * 4)(0, 0, 0, 1))
refused("grid", joined, "ts_collider_add", byref(grid), byref(upright), byref(c_int32()))
soft.call("ts_world_get_joint", joined, c_int32(0), byref(made))
soft.call("ts_joint_release", joined, made)
refused("released", joined, "ts_joint_release", made)
for slot in range(8):  # what is joined or driven, too
    if soft.body(joined, slot).value:
        soft.call("ts_world_despawn", joined, soft.body(joined, slot))
soft.step(joined)
soft.call("ts_world_get_motor", joined, c_int32(0), byref(made))
print(json.dumps([found, are_same, made.value]))
"""

WANTED = {
    "gravity": (ARGUMENT, "stay below"),
    "friction": (ARGUMENT, "give a number from 0"),
    "friction of a collider": (ARGUMENT, "collider 7 does not exist"),
    "friction between": (STATE, "export it with soft_contact"),
    "itself": (ARGUMENT, "give another body"),
    "far": (ARGUMENT, "move the two together first"),
    "twice": (ARGUMENT, "give each one once"),
    "axis": (ARGUMENT, "axis has zero length"),
    "line": (ARGUMENT, "are on a line"),
    "point": (ARGUMENT, "about a fixed axis"),
    "limit": (ARGUMENT, "limit is -1"),
    "grid": (ARGUMENT, "Python computes before the export"),
    "released": (HANDLE, "was released"),
}


def test_bad_calls_are_refused_with_a_way_out_and_change_nothing(native, export):
    found, are_same, motor = in_process(native, REFUSED, export("joined"), export("tilted"))
    assert found.keys() == WANTED.keys()
    for what, (code, text) in WANTED.items():
        assert found[what][0] == code, (what, found[what])
        assert text in found[what][1], (what, found[what])
    assert are_same
    assert motor == 0  # it ended with its body


SCRIPT = """
from taichi_soft import Material, World, box
world = World(sleep_speed=0, soft_contact=False, floor=None, gravity=(0, 0, 0))  # only the motor acts
jelly = Material(young=6e4, poisson=0.4, density=1000, damping_ratio=0.1)
crate = box((0.4, 0.4, 0.4), (2, 2, 2))
left, right = (world.add_body(crate, jelly, position=(0.42 * i, 0, 0.3)) for i in range(2))
world.build()
first = left.attach_to(right, [18, 19], onto=[0, 1])
hinges = [left.attach_to(right, [20], onto=[2])]
first.release()
engine = world.add_motor(right, [0, 1, 2, 5], (0, 0, 1), speed=2.0, max_torque=5.0)
"""

NAMED = """
scene = soft.load(arguments[0])
world, found = soft.create(scene), []
for kind, name, get in ((5, b"hinges[0]", "ts_world_get_joint"), (6, b"engine", "ts_world_get_motor")):
    number, handle = c_int32(), c_uint64()
    soft.call("ts_scene_find", scene, c_int32(kind), name, byref(number))
    soft.call(get, world, number, byref(handle))
    found.append([number.value, handle.value != 0])
speed = c_double()
for _ in range(30):
    soft.step(world)
soft.call("ts_motor_get_speed", world, handle, byref(speed))
print(json.dumps([found, speed.value]))
"""


def test_a_game_finds_joints_and_motors_by_the_names_of_its_script(native, tmp_path):
    (tmp_path / "game.py").write_text(SCRIPT)
    command = [
        "-m",
        "taichi_soft",
        "export",
        str(tmp_path / "game.py"),
        "--out",
        str(tmp_path / "game.softworld"),
    ]
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found, speed = in_process(native, NAMED, tmp_path / "game.softworld")
    assert found == [[1, True], [0, True]]
    assert 0.1 < speed < 2.0  # on the way to 2 rad/s
