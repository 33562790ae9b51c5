"""Kernels of an earlier process are reused, compute identical bits, and are never confused."""

import json
import os
import subprocess
import sys

import pytest

from taichi_soft.core.taichi_workarounds.known_kernels import INDEX

PROGRAM = """
import logging, sys
logging.basicConfig(level=logging.DEBUG)
from taichi_soft import Material, World, box, init
from taichi_soft.core import runtime
from taichi_soft.core.taichi_workarounds import kernel_digest
cells, room, bodies, threads = map(int, sys.argv[1:5])
runtime.available_cores = lambda: list(range(threads))  # of another machine
runtime.can_bind = lambda: False
if sys.argv[5]:
    runtime.VERSION, kernel_digest.digest_of_sources = sys.argv[5], lambda: sys.argv[5]
init("cpu", threads=threads)
world = World(soft_contact=False, sleep_speed=0, collider_room=room)
for i in range(bodies):
    world.add_body(box(cells=(cells,) * 3), Material(2e5, 0.3, 1000), position=(3 * i, 0, 0.6), law="virial")
world.build()
for _ in range(20):
    world.step(1 / 60, 12)
print(world.state_hash())
"""


def play(folder, cells=2, has_collider=False, bodies=1, threads=1, version=""):
    """State at the end, and the kernels that were made from their source and those that were known.

    `version`: for which the package is taken, with files of its own.
    """
    options = (cells, int(has_collider), bodies, threads, version)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, options)],
        env={**os.environ, "TI_OFFLINE_CACHE_FILE_PATH": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = [line for line in done.stderr.splitlines() if "compilation:kernel" in line]
    made = [line.split()[1] for line in lines if line.endswith("compiled")]
    made.remove("set_everywhere")  # it contains an address of the process
    known = [line.split()[1] for line in lines if line.endswith("from the cache")]
    return done.stdout.strip(), made, known


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A cache that one process has filled, and what it found at the end."""
    folder = tmp_path_factory.mktemp("kernels")
    state, made, known = play(folder)
    assert "step_islands" in made
    assert known == []
    return folder, state, made


@pytest.mark.soak
def test_a_later_process_makes_no_kernel_from_its_source_and_moves_bodies_alike(folder):
    folder, state, made = folder
    again, made_again, known = play(folder)
    assert made_again == []
    assert known == made
    assert again == state


@pytest.mark.soak
def test_a_world_of_another_size_takes_no_kernel_for_its_own(folder, tmp_path):
    folder, _, _ = folder
    sizes = (5, 7)  # some fields are equal, but at other addresses
    alone = [play(tmp_path / str(size), cells=size, has_collider=True)[0] for size in sizes]
    for _ in range(2):  # made first, and known then
        assert [play(folder, cells=size, has_collider=True)[0] for size in sizes] == alone
    assert len(set(alone)) == len(alone)


@pytest.mark.soak
def test_what_is_missing_from_the_cache_is_made_from_its_source_again(folder):
    folder, state, made = folder
    assert len(json.loads((folder / INDEX).read_text())) >= len(made)
    for path in folder.glob("T*.tic"):
        path.unlink()
    again, made_again, known = play(folder)
    assert again == state
    assert sorted(made_again) == sorted(made)
    assert known == []


@pytest.mark.soak
@pytest.mark.parametrize("has_collider", [False, True], ids=["without contact", "with contact"])
def test_a_machine_with_another_number_of_cores_finds_all_kernels_and_moves_bodies_alike(
    tmp_path, has_collider
):
    state, made, _ = play(tmp_path, has_collider=has_collider, bodies=2, threads=2)
    for threads in (3, 8):
        again, made_again, known = play(tmp_path, has_collider=has_collider, bodies=2, threads=threads)
        assert (again, made_again, known) == (state, [], made)


@pytest.mark.soak
def test_after_an_update_kernels_are_made_once_and_then_known(tmp_path):
    """Taichi would find those that did not change, under the names that they had before."""
    state, made, _ = play(tmp_path, version="a")
    assert play(tmp_path, version="b") == (state, made, [])
    assert play(tmp_path, version="b") == (state, [], made)
    assert play(tmp_path, version="a") == (state, [], made)
