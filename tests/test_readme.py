"""What the README prints has to run as printed."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from taichi_soft import LAWS, PRESETS
from taichi_soft.core.types import DampingModel, Flips, Integrator, Strain
from taichi_soft.render.demos import demo_names

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def run_blocks(*numbers: int) -> dict:
    names: dict = {}
    for number in numbers:
        exec(compile(BLOCKS[number], f"README block {number}", "exec"), names)
    return names


def test_the_ten_lines_of_embedding_code_drop_a_ball_onto_the_floor():
    lines = [line for line in BLOCKS[0].splitlines() if line and not line.startswith(("import", "from"))]
    assert len(lines) <= 10
    names = run_blocks(0)
    assert names["game"].total_dropped_time == 0.0
    assert names["world"].step_count == pytest.approx(90 / 75 * 60, abs=1)
    assert np.isfinite(names["vertices"]).all()
    assert -0.01 < names["vertices"][:, 2].min() < 1.2


def test_the_level_of_the_example_has_a_shot_a_lift_and_a_hand(capsys):
    names = run_blocks(1)
    assert names["world"].step_count == pytest.approx(90, abs=1)
    assert names["lift"].position[2] == pytest.approx(0.1 + 89 / 60, abs=0.02)
    assert 0.9 < names["crate"].center_of_mass()[2] < 2.0  # on its way to the hand, two metres up
    assert names["shot"].center_of_mass()[0] < -0.5  # thrown back by the crate
    assert any("Body(1" in line and "Body(0" in line for line in capsys.readouterr().out.splitlines())


def test_the_surface_example_writes_the_ball_where_it_lies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = run_blocks(0, 2)
    found = trimesh.load(tmp_path / "ball.glb", force="mesh")
    assert found.volume == pytest.approx(names["ball"].volume(), rel=1e-4)
    assert found.bounds[0, 2] == pytest.approx(names["ball"].positions()[:, 2].min(), abs=1e-5)


def test_the_force_example_pulls_a_stretched_box_together():
    names = run_blocks(3)
    top = names["mesh"].vertices[:, 2] > names["mesh"].vertices[:, 2].max() - 1e-9
    force = names["forces"][top, 2].sum()
    strain = (1.01**2 - 1) / 2
    assert force == pytest.approx(-2.0e7 * strain, rel=1e-9)  # cork: nu = 0, so the area stays 1 m^2


def test_the_fibres_of_the_example_spread_and_its_cloth_hangs():
    names = run_blocks(4)
    frames = names["world"].bodies[0].material.frame
    assert frames.shape[1:] == (3, 3)
    assert np.ptp(frames[:, 1, 0]) > 0
    names = run_blocks(5)
    z = names["flag"].positions()[:, 2]
    assert z.max() == pytest.approx(2.0, abs=0.01)
    assert z.min() < 1.9
    assert len(BLOCKS) == 6  # or another one runs nowhere


@pytest.mark.parametrize("names", [LAWS, PRESETS, demo_names()])
def test_every_name_there_is_stands_in_the_readme(names):
    for name in names:
        assert f"`{name}`" in TEXT or f'"{name}"' in TEXT


@pytest.mark.parametrize("choice", [Strain, Flips, DampingModel, Integrator])
def test_every_choice_there_is_stands_in_the_tables(choice):
    for member in choice:
        assert f'"{member.value}"' in TEXT


def test_every_file_the_readme_points_to_exists():
    for target in re.findall(r"\]\(([^)#]+)\)", TEXT):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target


def test_every_command_of_the_readme_exists():
    done = subprocess.run([sys.executable, "-m", "taichi_soft", "--help"], capture_output=True, text=True)
    for command in re.findall(r"^ +taichi-soft (\w+)", TEXT, re.MULTILINE):
        assert command in done.stdout
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"^ +make (\w+)", TEXT, re.MULTILINE):
        assert f"\n{target}:" in makefile
