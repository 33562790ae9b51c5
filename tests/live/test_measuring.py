"""Results of `taichi-soft live --measure`, for one sphere and a short time."""

import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from engine_adapter import FixedStep
from taichi_soft import sphere
from taichi_soft.live import measuring
from taichi_soft.live.meters import STEPS

pytestmark = pytest.mark.soak


def test_a_measurement_counts_what_is_sent_and_orders_its_percentiles(monkeypatch):
    monkeypatch.setattr(measuring, "COUNTS", (1,))
    monkeypatch.setattr(measuring, "SECONDS", 1.0)
    monkeypatch.setattr(measuring, "TURNS", 2)
    monkeypatch.setattr(measuring, "PULLS", 3)
    told = []
    (cost,) = measuring.measure(told.append)
    mesh = sphere(0.3, 4)
    outer = len({int(v) for v in mesh.surface.ravel()})
    assert told == ["1 spheres"]
    assert cost.triangles == len(mesh.surface)
    assert cost.packet == 48 + 10 * outer
    assert cost.pictures > 0.0
    for low, high in (cost.latency_ms, cost.alone_ms, cost.visited_ms):
        assert 0.0 < low <= high
    assert len(cost.ratios) == 2
    assert list(cost.ratios) == sorted(cost.ratios)


def test_no_step_of_the_turn_before_is_among_those_of_a_turn():
    assert STEPS * FixedStep().dt + 0.5 < measuring.SECONDS  # and a world tells them now and then
