"""What one process has compiled, the next one finds."""

import os
import subprocess
import sys

import pytest

pytestmark = [pytest.mark.soak, pytest.mark.guard]

PROGRAM = """
from taichi_soft import Material, World, box, init
init("cpu", threads=1)
world = World(soft_contact=True, collider_room=1)
world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.2, 1000.0, 20.0), position=(0, 0, 2))
world.build()
world.step(1 / 60, 4)
"""


def kernels_after_a_run(folder):
    environment = {**os.environ, "TI_OFFLINE_CACHE_FILE_PATH": str(folder)}
    subprocess.run([sys.executable, "-c", PROGRAM], check=True, env=environment, timeout=300)
    return {path.name for path in folder.rglob("*.tic")}


def test_later_processes_compile_nothing_again(tmp_path):
    """There are three processes, because a key that depends on addresses may be equal by chance."""
    first = kernels_after_a_run(tmp_path)
    assert len(first) > 5
    for _ in range(3):
        assert kernels_after_a_run(tmp_path) == first
