"""Kernels with every index checked, over fields without spare rows.

By `make test-bounds` only, as they compile slowly and nothing of them is kept.
"""

import os

import pytest

from taichi_soft.bodies import capacity
from taichi_soft.contact import colliders
from taichi_soft.core.runtime import DEBUG

if os.environ.get(DEBUG) != "1":
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(autouse=True)
def no_spare_rows(monkeypatch):
    """Allocate fields without spare rows. Otherwise, spare rows would hide reads beyond the end of a body."""
    for module in (capacity, colliders):
        monkeypatch.setattr(module, "room_for", lambda count, name: max(count, 1))
