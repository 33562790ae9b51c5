"""Keep the grids of these tests in a separate folder."""

import pytest


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    """Not made yet."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("TAICHI_SOFT_CACHE", str(folder))
    return folder
