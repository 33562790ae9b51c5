"""How long a start takes: each world in processes of its own, and a failure in one line."""

import pytest

from taichi_soft.core.errors import DeviceError
from taichi_soft.profiling import startup

pytestmark = pytest.mark.soak


def test_a_full_cache_is_quicker_and_the_first_frame_comes_before_all_is_warm():
    empty, full = startup.measure_startup("cpu", 1, (), ("plain",))
    assert (empty.world, empty.cache, full.cache) == ("plain", "empty", "full")
    assert 0 < full.first_frame < full.warm < empty.warm
    assert full.first_frame < empty.first_frame


def test_a_process_that_fails_is_told_by_its_last_line(monkeypatch):
    monkeypatch.setitem(startup.WORLDS, "broken", "raise ValueError('no such world')")
    with pytest.raises(DeviceError, match="no such world"):
        startup.measure_startup("cpu", 1, (), ("broken",))


@pytest.mark.parametrize("name", startup.WORLDS)
def test_each_world_can_be_built(name):
    names: dict = {}
    lines = startup.PROGRAM.format(arch="auto", threads=None, cores=None, world=startup.WORLDS[name])
    exec(lines.split("world.build()")[0], names)
    assert not names["world"].is_built
    assert names["body"].is_alive
