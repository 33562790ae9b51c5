"""Time in the native library: division into steps, and interpolation, as in `engine_adapter`."""

import json

import numpy as np
import pytest
from library import in_process

from engine_adapter.fixed_step import Accumulator, FixedStep

pytestmark = pytest.mark.soak

FRAMES = """
from ctypes import Structure
class Clock(Structure):
    _fields_ = [("struct_size", c_uint32), ("steps_made", c_int32), ("steps", c_int64), ("time", c_double),
                ("alpha", c_double), ("dropped", c_double)]
class Step(Structure):
    _fields_ = [("struct_size", c_uint32), ("substeps", c_int32), ("max_steps", c_int32), ("dt", c_double)]
world = soft.create(soft.load(arguments[0]))
step = Step(24, 4, 3, 1 / 60)
soft.call("ts_world_set_fixed_step", world, byref(step))
refused = []
bad = (4, 2**31 - 1, 1 / 60), (2_000_000, 3, 1 / 60), (4, 0, 1 / 60), (4, 3, float("nan"))
for substeps, most, dt in bad:
    refused.append(soft.raw.ts_world_set_fixed_step(world, byref(Step(24, substeps, most, dt))))
clock, rows = Clock(40), []
for seconds in json.loads(arguments[1]):
    soft.call("ts_world_advance", world, c_double(seconds), byref(clock))
    rows.append([clock.steps_made, clock.alpha, clock.dropped])
snapshot = soft.snapshot(world)
soft.restore(world, snapshot)
soft.call("ts_world_get_clock", world, byref(clock))
print(json.dumps([refused, rows, [clock.alpha, clock.dropped, clock.steps, clock.time]]))
"""


def test_frames_become_steps_as_in_python(native, export):
    frames = np.random.default_rng(1).choice([0.0, 1 / 60, 1 / 50, 1 / 144, 0.04, 0.2], 60).tolist()
    refused, rows, after = in_process(native, FRAMES, export("free"), json.dumps(frames))
    assert refused == [-1, -1, -1, -1]
    accumulator, dropped, steps = Accumulator(FixedStep(dt=1 / 60, max_steps=3)), 0.0, 0
    for seconds, row in zip(frames, rows, strict=True):
        made, lost = accumulator.put(seconds)
        dropped += lost
        steps += made
        assert row == [made, accumulator.alpha, pytest.approx(dropped, rel=1e-12)]
    assert after[:3] == [rows[-1][1], rows[-1][2], steps]  # values that a snapshot does not change
    assert after[3] == pytest.approx(steps / 60, rel=1e-9)


CALLED_BACK = """
import ctypes, threading
world = soft.create(soft.load(arguments[0]))
codes, inner = [], []
def others():
    hash = c_uint64()
    codes.append(soft.raw.ts_world_hash(world, byref(hash)))
@ctypes.CFUNCTYPE(None, c_uint64, ctypes.c_void_p)
def before(handle, user):
    thread = threading.Thread(target=others)
    thread.start()
    thread.join()
    hash = c_uint64()
    inner.append(soft.raw.ts_world_hash(c_uint64(handle), byref(hash)))
    inner.append(soft.raw.ts_world_advance(c_uint64(handle), c_double(0.1), None))
soft.call("ts_world_on_step", world, before, None)
soft.call("ts_world_advance", world, c_double(2.5 / 60), None)
others()
print(json.dumps([codes, inner]))
"""


def test_between_the_steps_of_a_frame_the_world_is_its_own_threads(native, export):
    """During a frame, calls from other threads are refused, and so is a frame within a frame."""
    codes, inner = in_process(native, CALLED_BACK, export("free"))
    assert codes == [-3, -3, 0]
    assert inner == [0, -7, 0, -7]


KINDS = """
scene = soft.load(arguments[0])
world = soft.create(scene)
body = soft.body(world, 0)
other = c_uint64()
found = [soft.raw.ts_world_create(world, byref(other))]
for handle in (scene, body):
    found.append(soft.raw.ts_world_step(handle, c_double(0.01), c_int32(1)))
status = c_int32()
found.append(soft.raw.ts_body_get_status(world, world, byref(status)))
print(json.dumps(found))
"""


def test_a_handle_of_one_kind_is_not_taken_for_another(native, export):
    assert in_process(native, KINDS, export("free")) == [-2, -2, -2, -2]
