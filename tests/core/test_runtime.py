"""Taichi starts once per process with the requested options, or not at all. Tests use separate processes."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from taichi_soft import OptionError, init
from taichi_soft.core.cores import available_cores, can_bind

ROOT = Path(__file__).parents[2]
CORES = available_cores()

binding = pytest.mark.skipif(
    not can_bind() or len(CORES) < 2, reason="threads are bound on Linux, with two cores or more"
)


def run(script, *arguments):
    """Run a script in a process of its own. Returns what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("arch", ["gpu", "CPU", "", None, 3])
def test_unknown_archs(arch):
    with pytest.raises(OptionError, match="arch"):
        init(arch)


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2", True, 100_000])
def test_thread_counts_that_are_none(threads):
    with pytest.raises(OptionError, match="threads"):
        init("cpu", threads=threads)


@binding
@pytest.mark.parametrize("cores", [[], [0, 0], [-1], [100_000], ["0"], [0.0], "0", 0, [True]])
def test_cores_that_are_none_to_bind_to(cores):
    with pytest.raises(OptionError, match=r"cores.*distinct"):
        init("cpu", cores=cores)


@binding
def test_cores_are_for_as_many_threads_of_the_cpu():
    with pytest.raises(OptionError, match="1 CPU threads"):
        init("cpu", threads=2, cores=CORES[:1])
    with pytest.raises(OptionError, match="arch='cuda'"):
        init("cuda", cores=CORES[:1])


def test_threads_are_bound_to_cores_only_where_the_system_can(monkeypatch):
    monkeypatch.setattr("taichi_soft.core.cores.sys", SimpleNamespace(platform="win32"))
    with pytest.raises(OptionError, match=r"/proc.*win32"):
        init("cpu", cores=[0])


@pytest.mark.soak
@binding
def test_the_threads_that_work_are_bound_to_a_core_each():
    """The system says where each thread may run, and which of them worked."""
    script = """
import os
from pathlib import Path
from taichi_soft import Material, OptionError, World, box, device, init
cores = sorted(os.sched_getaffinity(0), reverse=True)
init(cores=cores)
assert init() is init(cores=cores) and device().cores == tuple(cores) and device().threads == len(cores)
if len(cores) > 1:
    try:
        init(cores=cores[1:])
    except OptionError as error:
        assert "already runs on cores" in str(error)
    else:
        raise AssertionError(cores[1:])
    os.sched_setaffinity(0, {cores[0]})  # the caller's thread alone
    assert init(cores=cores) is device()
    os.sched_setaffinity(0, set(cores))
world = World(soft_contact=False, sleep_speed=0)
for i in range(8 * len(cores)):
    world.add_body(box(cells=(4, 4, 4)), Material(1e5, 0.2, 1000.0), position=(2 * i, 0, 1))
world.build()
world.step(1 / 60)
tasks = Path("/proc/self/task")
def worked():  # [ns]
    return {int(task.name): int((task / "schedstat").read_text().split()[0]) for task in tasks.iterdir()}
before = worked()
for _ in range(50):
    world.step(1 / 60, 100)
after = worked()
most = sorted((task for task in before if task != os.getpid()), key=lambda task: before[task] - after[task])
places = [os.sched_getaffinity(task) for task in most[: len(cores)]]
assert sorted(map(sorted, places)) == [[core] for core in sorted(cores)], places
assert os.sched_getaffinity(0) == set(cores)
print("done")
"""
    assert run(script) == "done\n"


@binding
def test_left_alone_each_core_has_a_thread_bound_to_it_and_a_number_of_threads_is_free():
    """Only the cores that the system allows are used.

    Threads that existed before, such as the caller's thread, stay as they were.
    """
    script = """
import os, sys
from taichi_soft import init
from taichi_soft.core.cores import thread_ids
there, before = os.sched_getaffinity(0), thread_ids()
device = init(**eval(sys.argv[1]))
places = [os.sched_getaffinity(thread) for thread in thread_ids() - before]
print(device.cores, sorted(min(place) for place in places if place != there))
assert all(os.sched_getaffinity(thread) == there for thread in before)
assert device.threads == len(there) and init() is init(threads=len(there)) is device
"""
    for options, bound in (({}, CORES), ({"threads": len(CORES)}, [])):
        assert run(script, repr(options)) == f"{tuple(bound)} {bound}\n"


@pytest.mark.soak
@binding
def test_where_the_system_refuses_no_thread_is_bound_and_cores_that_were_asked_for_are_an_error():
    """It refuses the second thread; the first is freed again."""
    script = """
import os, sys
from taichi_soft import DeviceError, init
from taichi_soft.core.cores import thread_ids
inner, asked = os.sched_setaffinity, []
def refuse(thread, cores):
    asked.append(thread)
    if len(asked) == 2:
        raise PermissionError(1, "Operation not permitted")
    inner(thread, cores)
os.sched_setaffinity = refuse
there = os.sched_getaffinity(0)
try:
    device = init(**eval(sys.argv[1]))
    print(device.cores, device.threads == len(there))
except DeviceError as error:
    print(error)
assert len(asked) > 2 and all(os.sched_getaffinity(thread) == there for thread in thread_ids())
"""
    refusal = f"cannot bind threads to cores {CORES}: [Errno 1] Operation not permitted. Leave cores out"
    for options, said in (({}, "() True"), ({"cores": CORES}, refusal)):
        assert run(script, repr(options)) == f"{said}\n"


@pytest.mark.soak
@binding
def test_left_alone_a_thread_that_somebody_else_starts_meanwhile_is_not_bound():
    script = """
import os, threading, time
from taichi_soft import init
from taichi_soft.core import runtime
inner, other = runtime.ti.init, threading.Thread(target=time.sleep, args=(60,), daemon=True)
def crowded(**options):
    inner(**options)
    other.start()
runtime.ti.init = crowded
print(init().cores)
assert os.sched_getaffinity(other.native_id) == os.sched_getaffinity(0)
"""
    assert run(script) == "()\n"


@pytest.mark.soak
@binding
def test_left_alone_threads_are_free_where_the_system_does_not_list_them():
    script = """
from taichi_soft import init
from taichi_soft.core import cores
cores._TASKS = "/nowhere"
print(init().cores)
"""
    assert run(script) == "()\n"


@pytest.mark.soak
def test_starting_again_otherwise():
    """In a process of its own: the first start fixes arch and threads, the second is a no-op or refused."""
    script = """
from taichi_soft import Material, OptionError, World, box, device, init
for bad in ({"arch": "gpu"}, {"threads": 0}):
    try:
        init(**bad)
    except OptionError:
        pass
    else:
        raise AssertionError(bad)
first = init("cpu", threads=1)
world = World()
body = world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0), position=(0, 0, 1))
world.build()
before = body.positions().tobytes()
assert init() is first and init("cpu") is first and init("cpu", threads=1) is first and device() is first
for bad in ({"arch": "cpu", "threads": 2}, {"arch": "vulkan"}):
    try:
        init(**bad)
    except OptionError as error:
        assert "already runs" in str(error)
    else:
        raise AssertionError(bad)
assert device() is first
assert body.positions().tobytes() == before
world.step(1 / 60)
print("done")
"""
    assert run(script) == "done\n"


def test_no_device_before_the_start():
    script = "from taichi_soft import device; device()"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert "DeviceError: Taichi is not started" in done.stderr


@pytest.mark.guard
@pytest.mark.soak
def test_more_threads_than_cores_are_not_waited_for():
    """The flat schedule's threads wait for each other, so there must be no more than run."""
    script = """
from taichi_soft import Material, World, box, device, init
from taichi_soft.core.cores import available_cores
init("cpu", threads=64)
assert device().threads == min(64, len(available_cores()))
init("cpu", threads=64)
world = World(schedule="flat")
world.add_body(box(cells=(4, 4, 4)), Material(1e5, 0.2, 1000.0), position=(0, 0, 1))
world.build()
world.step(1 / 60, 4)
print("done")
"""
    assert run(script) == "done\n"


def test_a_taichi_that_someone_else_started_is_left_alone():
    script = """
import taichi as ti
ti.init(ti.cpu)
x = ti.field(ti.f32, 3)
x[0] = 5.0
from taichi_soft import DeviceError, init
try:
    init()
except DeviceError as error:
    assert "call taichi_soft.init() instead" in str(error)
assert x[0] == 5.0
print("done")
"""
    assert run(script).endswith("done\n")
