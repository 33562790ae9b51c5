"""The number of threads, their scheduling and their rounding mode change no bit of a step."""

import pytest
from library import ARGUMENT, OK, in_process

pytestmark = pytest.mark.soak

STEPS = """
import ctypes, threading
Job = ctypes.CFUNCTYPE(None, ctypes.c_void_p, c_int32)
Run = ctypes.CFUNCTYPE(None, ctypes.c_void_p, c_int32, Job, ctypes.c_void_p)
counts = []
@Run
def in_turn(user, count, job, closure):
    counts.append(count)
    for number in range(count):
        job(closure, number)
@Run
def side_by_side(user, count, job, closure):
    threads = [threading.Thread(target=job, args=(closure, number)) for number in range(count)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
scene = soft.load(arguments[0])
def hashes(threads, host):
    world = soft.create(scene)
    soft.call("ts_world_set_threads", world, c_int32(threads))
    if host is not None:
        soft.call("ts_world_set_job_system", world, host, None)
    found = []
    for _ in range(60):
        soft.step(world)
        found.append(soft.hash(world))
    return found
plays = [(1, None), (2, None), (7, None), (3, in_turn), (3, side_by_side)]
found = [hashes(*each) for each in plays]
world = soft.create(scene)
codes = [soft.raw.ts_world_set_threads(world, c_int32(count)) for count in (0, -1, 257, 1)]
print(json.dumps([found, counts, codes]))
"""


def test_any_number_of_threads_and_the_host_s_own_give_the_same_bits(native, export):
    found, counts, codes = in_process(native, STEPS, export("heap"))
    assert len(set(found[0])) > 40
    assert all(each == found[0] for each in found)
    assert max(counts) > 2  # the host had something to share out
    assert codes == [ARGUMENT, ARGUMENT, ARGUMENT, OK]


ROUNDED = """
import ctypes
c = ctypes.CDLL(None)
toward_zero = 0xC00 if __import__("platform").machine() == "x86_64" else 0xC00000  # of fenv.h
world = soft.create(soft.load(arguments[0]))
if arguments[1] == "toward zero":
    assert c.fesetround(toward_zero) == 0
found = []
for _ in range(60):
    soft.call("ts_world_step", world, c_double(0.015625), c_int32(0))
    found.append(soft.hash(world))
is_left = c.fegetround() == toward_zero
c.fesetround(0)
print(json.dumps([found, is_left]))
"""


def test_a_thread_that_rounds_otherwise_gets_the_same_bits_and_rounds_so_afterwards(native, export):
    found, is_left = in_process(native, ROUNDED, export("heap"), "toward zero")
    usual, _ = in_process(native, ROUNDED, export("heap"), "to nearest")
    assert found == usual
    assert is_left
