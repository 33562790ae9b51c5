"""Experiments that compute nothing, and workers to run them."""

import sys
from pathlib import Path

import pytest

from lab.report import run

sys.path.insert(0, str(Path(__file__).parent))  # for `fakes`; worker processes inherit the path


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """Return the points that were measured since the last call."""
    log = tmp_path / "log"
    log.touch()
    monkeypatch.setenv("FAKES_LOG", str(log))
    return lambda: (log.read_text().split(), log.write_text(""))[0]


def compute_here(tasks, *, workers, arch, time_limit):
    """Compute tasks like `compute_all`, but in this process."""
    for task in tasks:
        try:
            yield task, run.Outcome(task.function(task.point))
        except ValueError as error:
            yield task, run.Outcome(None, str(error))


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(run, "compute_all", compute_here)
