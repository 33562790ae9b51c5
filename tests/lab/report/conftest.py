"""Experiments that cost nothing, and where they are computed."""

import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from lab.report import run

sys.path.insert(0, str(Path(__file__).parent))  # for `fakes`; worker processes take it over


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """Which points were measured since it was asked last."""
    log = tmp_path / "log"
    log.touch()
    monkeypatch.setenv("FAKES_LOG", str(log))
    return lambda: (log.read_text().split(), log.write_text(""))[0]


class Here:
    """Computes in this process."""

    def is_ready(self):
        return True

    def compute(self, task, time_limit):
        try:
            return run.Outcome(task.function(task.point))
        except ValueError as error:
            return run.Outcome(None, str(error))

    def stop(self):
        pass


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(run, "local_workers", lambda workers, arch: nullcontext([Here()]))
