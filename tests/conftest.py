"""For all tests: a world that is gone gives its state and its compiled kernels to the next one."""

import gc

import pytest
from hypothesis import settings

settings.register_profile("same every time", derandomize=True, deadline=None)
settings.load_profile("same every time")


@pytest.fixture(autouse=True, scope="session")
def settle_imports():
    """What the imports made stays: the collector need not walk it after every test."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def release_worlds():
    """World and bodies name each other, so only the collector ends them."""
    yield
    gc.collect()
