"""Worker processes on this machine: an error at one point affects no other point."""

import os
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from acts import act

from lab.sweep import Task, compute_all

pytestmark = pytest.mark.soak

TIME_LIMIT = 12.0
"""For a point that hangs [s]: longer than a shared machine stands still now and then."""


def compute(points):
    """Return the outcomes by x, in the order in which two processes report them."""
    tasks = [Task("a", act, p, p.pop("is_alone", False)) for p in points]
    with closing(compute_all(tasks, workers=2, time_limit=TIME_LIMIT)) as done:
        return {task.point["x"]: outcome for task, outcome in done}


@pytest.fixture(scope="module")
def rough():
    """Compute valid points, and points that raise an error, end the process, hang or return invalid data."""
    acts = ("", "raise", "", "exit", "", "kill", "", "sleep", "", "numpy", "number", "")
    return compute([{"x": x, "do": do, "seconds": 600} for x, do in enumerate(acts)])


@pytest.mark.guard
def test_every_point_has_an_outcome_whatever_happens_to_others(rough):
    assert sorted(rough) == list(range(12))
    for x in (0, 2, 4, 6, 8, 11):
        assert rough[x].numbers["root"] == len(str(x)) ** 0.5
        assert rough[x].error == ""


@pytest.mark.parametrize(
    ("x", "error"),
    [
        (1, "ValueError: no numbers (acts.py:"),
        (3, "its process was lost: exit code 7"),
        (5, "its process was lost: killed by SIGKILL"),
        (7, "stopped: it took longer than 12 s"),
        (9, "TypeError: Object of type float32 is not JSON serializable"),
        (10, "TypeError: measured float"),
    ],
)
def test_a_failed_point_says_why(rough, x, error):
    assert rough[x].numbers is None
    assert rough[x].error.startswith(error)
    assert "\n" not in rough[x].error
    assert rough[x].seconds < 30


def test_numbers_come_as_they_come_from_a_file(rough):
    pair = rough[0].numbers["pair"]
    assert pair[0] == 1
    assert pair[1] != pair[1]
    assert isinstance(pair, list)


def test_what_is_timed_runs_alone_after_all_else():
    points = [{"x": x, "do": "sleep", "seconds": 0.1, "is_alone": x < 4} for x in range(8)]
    outcomes = compute(points)
    assert list(outcomes)[4:] == [0, 1, 2, 3]
    begun = {x: outcomes[x].numbers["begun"] for x in outcomes}
    assert begun[0] > max(begun[x] + 0.1 for x in range(4, 8))
    assert all(begun[x + 1] > begun[x] + 0.1 for x in range(3))


PROGRAM = """
import sys
from contextlib import closing
from lab.sweep import Task, compute_all
sys.path.insert(0, {folder!r})
from acts import act

if __name__ == "__main__":
    tasks = [Task("a", act, {{"x": x, "do": "sleep", "seconds": {seconds} * x}}) for x in range(2)]
    with closing(compute_all(tasks, workers=1)) as done:
        for task, outcome in done:
            print(outcome.numbers["pid"], flush=True)
"""


def begun(tmp_path, seconds):
    """Start a program that computes one point, and then a long one."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM.format(folder=str(Path(__file__).parent), seconds=seconds))
    return subprocess.Popen(
        [sys.executable, str(program)],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True},
    )


def test_where_the_program_is_killed_its_processes_end_with_their_points(tmp_path):
    """They have its output, which ends with the last of them."""
    with begun(tmp_path, seconds=1) as process:
        process.stdout.readline()
        process.kill()
        process.communicate(timeout=60)


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C of a terminal, as POSIX has it")
def test_ctrl_c_ends_all_processes_at_once_and_without_their_tracebacks(tmp_path):
    """The terminal sends Ctrl-C to the workers, too."""
    with begun(tmp_path, seconds=600) as process:
        worker = int(process.stdout.readline())
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=120)  # their points take longer
    assert errors.count("Traceback") == 1  # of the program itself
    assert errors.rstrip().endswith("KeyboardInterrupt")
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)
