"""The same bits for any number of threads and from run to run: here, and in a process with another number."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from thread_scenes import SCENES

from taichi_soft import init

pytestmark = [pytest.mark.soak, pytest.mark.guard]

PROGRAM = Path(__file__).parents[1] / "shared" / "thread_scenes.py"


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory):
    """Return the results of every scene in a new process with two threads if this process has one thread."""
    threads = 2 if init().threads == 1 else 1
    out = tmp_path_factory.mktemp("threads") / "found.json"
    subprocess.run([sys.executable, str(PROGRAM), str(threads), str(out)], check=True, timeout=600)
    return json.loads(out.read_text())


@pytest.mark.parametrize("name", SCENES)
def test_same_bits_for_one_thread_and_two(elsewhere, name):
    assert SCENES[name]() == elsewhere[name]


@pytest.mark.parametrize("name", ["fallen, per body", "fallen, flat"])
def test_same_bits_in_a_second_world(elsewhere, name):
    """The second world reuses the fields of the first world."""
    assert SCENES[name]() == elsewhere[name]
