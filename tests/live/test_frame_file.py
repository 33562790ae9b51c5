"""Frames in shared memory of two processes: complete and newest frames only, without waiting."""

import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft.live.frame_file import FrameFile

WRITER = """
import sys, time
from pathlib import Path
from taichi_soft.live.frame_file import FrameFile
frames = FrameFile(Path(sys.argv[1]), 20_000, 3)
end = time.monotonic() + 3.0
while time.monotonic() < end:
    frame = frames.begin()
    number = frames.newest_number + 1
    frame.positions[:], frame.normals[:], frame.poses[:] = number, -number, number
    frame.tints[:] = number % 256
    frames.publish(7, 0.5 * number, is_tinted=number % 2 == 1)
"""


def test_there_is_no_picture_before_the_first(tmp_path):
    assert FrameFile(tmp_path / "frames", 10, 0, is_new=True).newest() is None


@pytest.mark.soak
def test_a_reader_never_sees_half_a_picture_while_another_process_writes(tmp_path):
    frames = FrameFile(tmp_path / "frames", 20_000, 3, is_new=True)
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path / "frames")])
    seen = []
    while writer.poll() is None:
        frame = frames.newest()
        if frame is None:
            time.sleep(0.001)
            continue
        whole = np.float32(frame.number)
        assert (frame.positions == whole).all()
        assert (frame.normals == -whole).all()
        assert (frame.poses == whole).all()
        assert (frame.tints == frame.number % 256).all()
        assert (frame.version, frame.time) == (7, 0.5 * frame.number)
        assert frame.is_tinted == (frame.number % 2 == 1)
        seen.append(frame.number)
    assert writer.returncode == 0
    assert seen == sorted(seen)
    assert len(set(seen)) > 20


def test_the_writer_does_not_wait_for_a_reader_that_stands_still(tmp_path):
    frames = FrameFile(tmp_path / "frames", 5, 0, is_new=True)
    for number in range(1, 100):
        frames.begin().positions[:] = number
        frames.publish(1, 0.0, is_tinted=False)
    newest = frames.newest()
    assert newest.number == 99
    assert (newest.positions == 99).all()
