"""Kernels with every index checked, over fields without spare rows.

By `make test-bounds` only, as they compile slowly and nothing of them is kept.
"""

import os

import pytest

from taichi_soft.bodies import fields as state
from taichi_soft.core.runtime import DEBUG

if os.environ.get(DEBUG) != "1":
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(autouse=True)
def no_spare_rows(monkeypatch):
    """Fields are otherwise as long as the next power of two, and hide what is read behind a body's end."""
    monkeypatch.setattr(state, "_power_of_two", lambda count, least: max(count, 1))
