"""Grids of these tests are kept in a folder of their own."""

import pytest


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    """Not made yet."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("TAICHI_SOFT_CACHE", str(folder))
    return folder
