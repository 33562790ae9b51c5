"""Data packets for a page: decoded here, they equal the original data to half a quantisation step."""

import numpy as np
import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from visitor import decoded_drawn, decoded_picture

from taichi_soft.live.frame_file import Frame
from taichi_soft.live.packets import drawn_packet, picture_packet


@pytest.mark.parametrize("count", [0, 1, 7, 1000])
def test_positions_arrive_within_half_a_step_and_normals_within_a_127th(count):
    rng = np.random.default_rng(count)
    positions = rng.uniform(-3.0, 40.0, (count, 3)).astype(np.float32)
    normals = rng.normal(size=(count, 3))
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    tints, poses = rng.integers(0, 256, count, np.uint8), rng.normal(size=(2, 12)).astype(np.float32)
    frame = Frame(9, 4, 1.25, True, positions, normals, tints, poses)
    found = decoded_picture(picture_packet(1, frame))
    assert (found["pane"], found["number"], found["version"], found["time"]) == (1, 9, 4, 1.25)
    # Half a step, and the rounding of float32 at 40 m.
    assert (np.abs(found["positions"] - positions) <= 0.5 * found["quantum"] + 1e-5).all()
    assert np.abs(found["normals"] - normals).max(initial=0.0) <= 0.5 / 127 + 1e-6
    assert (found["tints"] == tints // 2).all()
    assert (found["poses"] == poses).all()


def test_a_body_that_flew_away_takes_nothing_from_the_others():
    near = np.random.default_rng(1).uniform(0.0, 3.0, (200, 3)).astype(np.float32)
    rows = np.concatenate([near, np.full((20, 3), 1e5, np.float32)])
    frame = Frame(
        1, 1, 0.0, False, rows, np.zeros_like(rows), np.zeros(220, np.uint8), np.zeros((0, 12), "f4")
    )
    found = decoded_picture(picture_packet(0, frame))["positions"]
    assert np.abs(found[:200] - near).max() < 0.01


def test_what_is_drawn_arrives_as_it_was():
    arrays = {"triangles": np.arange(9, dtype="<u4").reshape(3, 3), "colors": np.arange(15, dtype=np.uint8)}
    arrays["rows"] = np.array([[0.5, 1.5]], dtype="<f4")
    pane, header, found = decoded_drawn(drawn_packet(0, {"title": "Würfel"}, arrays))
    assert (pane, header["title"]) == (0, "Würfel")
    for name, rows in arrays.items():
        assert (found[name] == rows).all(), name
