"""Keep the grids of these tests in a separate folder."""

import pytest


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    """Return the path of a cache folder that does not exist yet."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("TAICHI_SOFT_CACHE", str(folder))
    return folder
