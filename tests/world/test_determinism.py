"""The same bits from run to run and for any number of threads, in fresh processes."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = """
import gc
import sys
import numpy as np
from taichi_soft import Material, World, box, init, sphere
threads, out = int(sys.argv[1]), sys.argv[2]
init("cpu", threads=threads)
rows = {}
for schedule in ("per_body", "flat"):
    for turn in range(2):
        world = World(schedule=schedule)
        for i in range(3):
            mesh = sphere(0.5, 3) if i else box(cells=(2, 2, 2))
            world.add_body(mesh, Material(1e5, 0.2, 1000.0, 20.0), position=(2 * i, 0, 0.51 + 0.02 * i))
        world.build()
        for _ in range(25 if schedule == "per_body" else 8):
            world.step(1 / 60, 6)
        rows[f"{schedule}{turn}"] = np.concatenate([body.positions() for body in world.bodies])
        rows[f"{schedule}{turn}v"] = np.concatenate([body.velocities() for body in world.bodies])
        del world
        gc.collect()  # gives the state back, so that the second turn finds its kernels compiled
np.savez(out, **rows)
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Positions and velocities by schedule and turn, for processes with 1 and 2 threads."""
    folder = tmp_path_factory.mktemp("runs")
    found = []
    for number, threads in enumerate((1, 2)):
        out = folder / f"{number}.npz"
        subprocess.run(
            [sys.executable, "-c", SCRIPT, str(threads), str(out)], cwd=ROOT, check=True, timeout=300
        )
        found.append(dict(np.load(out)))
    return found


@pytest.mark.parametrize("schedule", ["per_body", "flat"])
@pytest.mark.parametrize("kind", ["", "v"])
def test_same_bits_for_any_run_and_thread_count(runs, schedule, kind):
    expected = runs[0][f"{schedule}0{kind}"]
    assert np.isfinite(expected).all()
    for run in runs:
        for turn in range(2):
            assert run[f"{schedule}{turn}{kind}"].tobytes() == expected.tobytes()
