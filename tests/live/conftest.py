"""A live world that the command line serves, as visitors find it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # modules that the tests of this folder share

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from visitor import Visitor


class Served:
    """The command `taichi-soft live` in a separate process."""

    def __init__(self, *arguments):
        command = [sys.executable, "-m", "taichi_soft", "live", "--port", "0", "--no-browser", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found, line
        self.address = found.group()

    def end(self):
        """Stop the command like Ctrl-C. Returns: the exit code."""
        self.process.terminate()
        code = self.process.wait(30)
        self.process.stdout.close()
        return code


@pytest.fixture(scope="module")
def served():
    """The playground, ready."""
    served = Served()
    try:
        with Visitor(served.address) as visitor:
            visitor.ready()
        yield served
    finally:
        code = served.end()
    assert code == 0


@pytest.fixture
def visitor(served):
    """Return a new visitor. The world is in its initial state."""
    with Visitor(served.address) as visitor:
        visitor.ready()
        visitor.say("pause", is_paused=True)
        visitor.until(lambda: visitor.states[0]["is_paused"])  # so what follows is seen to be done
        visitor.say("preset", name=None)
        visitor.say("reset")
        visitor.say("pause", is_paused=False)
        visitor.until(lambda: visitor.states[0]["time"] < 1.0 and not visitor.states[0]["is_paused"])
        yield visitor


@pytest.fixture
def serve():
    """A function that serves other scenes, until the test ends."""
    started = []

    def started_with(*arguments):
        started.append(Served(*arguments))
        return started[-1]

    yield started_with
    for each in started:
        assert each.end() == 0
