"""Calls from any thread, one at a time per world; calls from a process forked after the start are refused."""

import asyncio
import inspect
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import taichi_soft
from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    Material,
    MeshShape,
    StateError,
    box,
    force_gradient,
    init,
    internal_forces,
)
from taichi_soft.core.handles import Handle
from taichi_soft.world.bare import bare_world

ROOT = Path(__file__).parents[2]
CUBE, JELLY = box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0)
DT = 1 / 60


def made(**options):
    world = bare_world(**options)
    world.add_body(CUBE, JELLY, position=(0, 0, 0.52), velocity=(0, 0, -3))
    world.build()
    return world


def played(world):
    for _ in range(8):
        world.step(DT)
    return world.state_hash()


def in_threads(*functions):
    """Call functions at once, each in a separate thread. Return their results or exceptions."""
    found = [None] * len(functions)

    def call(i):
        try:
            found[i] = functions[i]()
        except Exception as error:
            found[i] = error

    threads = [threading.Thread(target=call, args=(i,), name=f"t{i}") for i in range(len(functions))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(400)  # they compile
        assert not thread.is_alive()
    return found


@pytest.fixture(scope="module")
def fallen():
    """The hash of the cube after its fall, all of it made in this thread."""
    init()
    return played(made())


@pytest.mark.soak
def test_worlds_that_compile_at_once_in_two_threads_are_the_same_to_the_bit(fallen):
    worlds = [made(), made()]  # of fields of their own: neither has a kernel yet
    assert in_threads(*(lambda world=world: played(world) for world in worlds)) == [fallen, fallen]


def test_another_thread_than_the_start_builds_and_shapes_while_a_game_goes_on(fallen):
    game, stop = made(), threading.Event()

    def load():
        try:
            return MeshShape((CUBE.vertices, CUBE.surface), cell=0.1, cache=False), played(made())
        finally:
            stop.set()

    def play():
        first = played(game)
        while not stop.is_set():
            game.step(DT)
        return first

    (shape, second), first = in_threads(load, play)
    assert first == second == fallen
    here = MeshShape((CUBE.vertices, CUBE.surface), cell=0.1, cache=False)
    assert shape.samples.tobytes() == here.samples.tobytes()


def test_an_event_loop_may_step_in_threads_of_its_pool(fallen):
    async def play(world):
        for _ in range(8):
            await asyncio.to_thread(world.step, DT)
        return world.state_hash()

    assert asyncio.run(play(made())) == fallen


def test_forces_asked_for_in_two_threads_are_those_of_one():
    stretched = [CUBE.vertices * (1, 1, 1 + 0.01 * k) for k in range(1, 9)]

    def ask(rows):
        return lambda: [internal_forces(CUBE, JELLY, x) for x in rows]

    def ask_gradient():
        return force_gradient(CUBE, JELLY, stretched[0], law="st_venant_kirchhoff")

    expected = [ask(stretched)(), ask(stretched[::-1])(), ask_gradient()]
    found = in_threads(ask(stretched), ask(stretched[::-1]), ask_gradient)
    assert all(np.array_equal(a, b) for a, b in zip(found, expected, strict=True))


class Slow:
    """A vector whose numbers are read between `began` and `may_end`."""

    def __init__(self):
        self.began, self.may_end = threading.Event(), threading.Event()

    def __array__(self, dtype=None, copy=None):
        self.began.set()
        assert self.may_end.wait(60)
        return np.zeros(3)


def test_every_call_of_a_second_thread_is_refused_by_name_and_changes_nothing():
    world = made(collider_room=1)
    game = EngineAdapter(world, FixedStep(DT), rewind_ticks=2)
    frame, body = world.add_frame(), world.bodies[0]
    handles = [world, body, frame, body.attach([0], frame), body.grab(0), world.floor_collider]
    before, slow, refused = world.snapshot(), Slow(), []
    (holding := threading.Thread(target=body.apply_impulse, args=(slow,), name="the game")).start()
    assert slow.began.wait(60)
    try:
        for handle in handles:
            for name, method in inspect.getmembers(type(handle), inspect.isfunction):
                if not name.startswith("_"):
                    with pytest.raises(StateError, match=r"'MainThread'.*'the game'"):
                        method(handle)
                    refused.append((type(handle), name))
        for call in (lambda: body.failure, game.step, lambda: game.advance(DT / 2), lambda: game.rewind(1)):
            with pytest.raises(StateError, match="one thread at a time"):
                call()
    finally:
        slow.may_end.set()
        holding.join(60)
    assert len(refused) > 60
    assert world.snapshot() == before
    assert (game.alpha, game.total_dropped_time) == (0.0, 0.0)


def all_below(kind):
    return {each for sub in kind.__subclasses__() for each in (sub, *all_below(sub))}


def test_all_handles_let_one_thread_in():
    kinds = [kind for kind in all_below(Handle) if hasattr(taichi_soft, kind.__name__)]
    assert {kind.__name__ for kind in kinds} == {
        *("World", "Body", "Collider", "Frame", "Grab", "Attachment", "Joint", "Motor")
    }
    for kind in kinds:
        public = [m for name, m in inspect.getmembers(kind, inspect.isfunction) if not name.startswith("_")]
        assert public
        assert all(hasattr(method, "__wrapped__") for method in public), kind


def run(script):
    """Exit status and what a process of its own prints and complains of."""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.soak
@pytest.mark.skipif(not hasattr(os, "fork"), reason="only some systems fork")
def test_a_child_that_is_forked_after_the_start_is_told_at_once_and_ends():
    script = """
import os, sys, warnings
warnings.simplefilter("ignore")
from taichi_soft import Material, MeshShape, StateError, World, box, internal_forces
mesh, jelly = box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0)
world = World()
body = world.add_body(mesh, jelly, position=(0, 0, 1))
world.build()
world.step(1 / 60)
child = os.fork()
if child == 0:
    calls = (World, lambda: world.step(1 / 60), body.positions, world.snapshot,
        lambda: MeshShape((mesh.vertices, mesh.surface), cell=0.3, cache=False),
        lambda: internal_forces(mesh, jelly, mesh.vertices))
    for call in calls:
        try:
            call()
        except StateError as error:
            assert f"process {os.getpid()} was forked from process {os.getppid()}" in str(error), error
            assert "'spawn'" in str(error)
        else:
            raise AssertionError(call)
    sys.exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
world.step(1 / 60)
print("done")
"""
    status, out, errors = run(script)
    assert (status, out) == (0, "done\n"), errors


@pytest.mark.guard
@pytest.mark.soak
def test_a_spawned_process_makes_the_same_world(tmp_path):
    """Beside a process in which Taichi runs."""
    program = tmp_path / "spawning.py"
    program.write_text("""
import multiprocessing
from taichi_soft import Material, World, box

def fall(_):
    world = World()
    world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0), position=(0, 0, 0.52))
    world.build()
    for _ in range(20):
        world.step(1 / 60)
    return world.state_hash()

if __name__ == "__main__":
    here = fall(0)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        print(pool.map(fall, [0]) == [here])
""")
    done = subprocess.run(
        [sys.executable, str(program)], cwd=ROOT, capture_output=True, text=True, timeout=120,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr


LOADING = """
import threading
from taichi_soft import Material, World, box

def load(level):
    world = World()
    world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0), position=(0, 0, 0.52))
    world.build()
    world.step(1 / 60)
    level.append(world)

level = []
loading = threading.Thread(target=load, args=(level,))
loading.start()
while loading.is_alive():
    loading.join(1 / 60)
for world in level:
    for _ in range(20):
        world.step(1 / 60)
load(level)
for _ in range(20):
    level[1].step(1 / 60)
assert level[0].state_hash() == level[1].state_hash()
print("done")
"""


@pytest.mark.soak
def test_a_game_that_loads_in_a_thread_which_ends_plays_and_loads_on_elsewhere():
    assert run(LOADING)[:2] == (0, "done\n")


@pytest.mark.soak
def test_a_notebook_runs_cells_within_its_event_loop_and_writes_elsewhere():
    """Cells run in the main thread, inside an event loop, and output goes to an object, as in ipykernel."""
    script = """
import asyncio, io, sys
sys.stdout = io.StringIO()
cells = [
    "from taichi_soft import Material, World, box",
    "world = World(); world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0), position=(0, 0, 1))",
    "world.build(); world.step(1 / 60); print(world.step_count)",
    "task = asyncio.ensure_future(asyncio.to_thread(world.step, 1 / 60))",
    "task.result(); print(world.step_count)",
]
names = {"asyncio": asyncio}
async def kernel():
    for cell in cells:
        exec(compile(cell, "cell", "exec"), names)
        while "task" in names and not names["task"].done():
            await asyncio.sleep(0.01)
asyncio.run(kernel())
sys.__stdout__.write(sys.stdout.getvalue())
"""
    status, out, errors = run(script)
    assert (status, out.split()[-2:]) == (0, ["1", "2"]), errors
