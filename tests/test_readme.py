"""What the README prints has to run as printed, and where it points to there has to be something."""

import re
import subprocess
import sys
from pathlib import Path

from taichi_soft.core.version import VERSION

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def test_it_has_at_most_120_lines():
    assert len(TEXT.splitlines()) <= 120


def test_the_loop_says_how_the_ball_falls_and_is_squashed(capsys):
    (block,) = BLOCKS
    exec(compile(block, "README", "exec"), {})
    lines = [
        re.fullmatch(r"([\d.]+) s: from (-?[\d.]+) to (-?[\d.]+) m", line)
        for line in capsys.readouterr().out.splitlines()
    ]
    times, low, high = zip(*[map(float, line.groups()) for line in lines], strict=True)
    assert len(times) == 9
    assert (low[0], high[0]) == (1.5, 2.5)
    falling = [(t, z) for t, z in zip(times, low, strict=True) if t < 0.55]
    assert all(abs(1.5 - 9.81 / 2 * t**2 - z) < 0.03 for t, z in falling)
    sizes = [top - bottom for top, bottom in zip(high, low, strict=True)]
    assert min(low) > -0.02
    assert min(sizes) < 0.8  # of a ball of 1 m


def test_every_file_it_points_to_exists():
    for target in re.findall(r"\]\(([^)#]+)\)", TEXT):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target


def test_every_command_it_prints_exists():
    done = subprocess.run([sys.executable, "-m", "taichi_soft", "--help"], capture_output=True, text=True)
    for command in re.findall(r"taichi-soft (\w+)[` ]", TEXT):
        assert command in done.stdout
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"^ +make (\w+)", TEXT, re.MULTILINE):
        assert f"\n{target}:" in makefile


def test_the_wheel_it_names_is_of_this_version():
    assert f"taichi_soft-{VERSION}-py3-none-any.whl" in TEXT
