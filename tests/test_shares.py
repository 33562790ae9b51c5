"""How test files are shared among workers: with simulated workers, and with real ones that crash."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from shares import Shares

pytestmark = pytest.mark.numpy


class Worker:
    """Starts a test only when it has the next one or none will come, as workers of pytest-xdist do."""

    gateway = SimpleNamespace(id="worker")

    def __init__(self):
        self.queue, self.ran, self.end, self.shutting_down = [], [], None, False

    def send_runtest_some(self, indices):
        self.queue += indices

    def shutdown(self):
        self.shutting_down = True


def play(tests, count, cache):
    """Run tests of given durations on simulated workers. Returns the tests of each, and the time [s]."""
    names, workers, cleanups = list(tests), [Worker() for _ in range(count)], []
    config = SimpleNamespace(
        cache=SimpleNamespace(get=cache.get, set=cache.__setitem__),
        add_cleanup=cleanups.append,
        getvalue={"tx": ["popen"] * count}.get,
        option=SimpleNamespace(loadscopereorder=True),
    )
    shares = Shares(config)
    for worker in workers:
        shares.add_node(worker)
    for worker in workers:
        shares.add_node_collection(worker, names)
    shares.schedule()
    now = 0.0
    while not all(worker.shutting_down and not worker.queue for worker in workers):
        for worker in workers:
            if worker.end is None and len(worker.queue) > (not worker.shutting_down):
                worker.end = now + tests[names[worker.queue[0]]]
        worker = min((worker for worker in workers if worker.end is not None), key=lambda worker: worker.end)
        now, worker.end = worker.end, None
        worker.ran.append(names[worker.queue[0]])
        shares.mark_test_complete(worker, worker.queue.pop(0), tests[worker.ran[-1]])
    for cleanup in cleanups:
        cleanup()
    return [worker.ran for worker in workers], now


def files_of(tests):
    return list(dict.fromkeys(test.split("::")[0] for test in tests))


FIRST_SLOW = {f"{file}.py::test_{i}": 4.0 if file in "ab" else 1.0 for file in "abcdefgh" for i in range(4)}
"""Eight files of four tests each; the first two take 16 s each, the others 4 s."""


def test_without_a_record_tests_count_equally_and_an_idle_worker_takes_the_last_file_of_the_other():
    first, second = play(FIRST_SLOW, 2, {})[0]
    assert files_of(first) == ["a.py", "b.py"]
    assert files_of(second) == ["e.py", "f.py", "g.py", "h.py", "d.py", "c.py"]


def test_recorded_durations_cut_the_shares():
    cache = {}
    play(FIRST_SLOW, 2, cache)
    (first, second), seconds = play(FIRST_SLOW, 2, cache)
    assert files_of(first) == ["a.py", "b.py"]
    assert files_of(second) == ["c.py", "d.py", "e.py", "f.py", "g.py", "h.py"]
    assert seconds == 32.0


def test_later_durations_do_not_move_the_shares():
    cache = {}
    play(FIRST_SLOW, 2, cache)
    play(dict.fromkeys(FIRST_SLOW, 1.0), 2, cache)
    assert files_of(play(FIRST_SLOW, 2, cache)[0][1]) == ["c.py", "d.py", "e.py", "f.py", "g.py", "h.py"]


@pytest.mark.parametrize("count", [1, 2, 3, 5, 9])
def test_every_test_runs_once_in_the_order_of_its_file(count):
    ran = play(FIRST_SLOW, count, {})[0]
    assert sorted(test for tests in ran for test in tests) == sorted(FIRST_SLOW)
    for tests in ran:
        assert all(tests[i : i + 4] == sorted(tests[i : i + 4]) for i in range(0, len(tests), 4))
        assert len(files_of(tests)) == len(tests) / 4


class EndedWorker(Worker):
    """Its channel is closed already, and the scheduler has not heard of it."""

    def send_runtest_some(self, indices):
        raise OSError("cannot send (already closed?)")


def test_a_crash_gives_no_files_to_a_worker_that_still_starts_and_takes_them_back_from_one_that_has_ended():
    names, config = (
        list(FIRST_SLOW),
        SimpleNamespace(
            cache=SimpleNamespace(get=lambda key, default: default, set=None),
            add_cleanup=lambda function: None,
            getvalue={"tx": ["popen"] * 2}.get,
            option=SimpleNamespace(loadscopereorder=True),
        ),
    )
    shares, sound, ended, new = Shares(config), Worker(), EndedWorker(), Worker()
    for worker in (sound, ended):
        shares.add_node(worker)
        shares.add_node_collection(worker, names)
    shares.schedule()
    shares.add_node(new)
    assert shares.remove_node(ended) in names
    assert new.queue == []
    shares.add_node_collection(new, names)
    shares.schedule()
    assert new.queue != []


def test_a_test_that_ends_its_worker_is_reported_once_and_all_others_run(tmp_path):
    """Two of seven files have such a test, and leave a single test to the new worker."""
    (tmp_path / "conftest.py").write_text(
        "import sys\n"
        f"sys.path.insert(0, {str(Path(__file__).parent / 'shared')!r})\n"
        "from shares import Shares\n"
        "def pytest_xdist_make_scheduler(config, log):\n"
        "    return Shares(config, log)\n"
    )
    for i in range(7):
        (tmp_path / f"test_{i}.py").write_text("def test():\n    pass\n")
    for i in (1, 6):
        (tmp_path / f"test_{i}.py").write_text(
            "import os\ndef test():\n    os._exit(1)\ndef test_after():\n    pass\n"
        )
    options = ("-n", "2", "--dist", "loadscope", "--rootdir", tmp_path)
    command = [sys.executable, "-m", "pytest", *options, tmp_path]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert "2 failed, 7 passed" in done.stdout
