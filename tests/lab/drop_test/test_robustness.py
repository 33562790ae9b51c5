"""Cells of the sweep: their selection, and the verdict on each of them."""

import json
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from lab.drop_test.robustness import GROUPS, Verdict, choose_cells, law_variants, run_cell
from lab.drop_test.robustness.cells import AXES, USUAL
from lab.drop_test.robustness.verdict import Ending, judge
from lab.drop_test.robustness.wrecks import WRECKS, distance_from_rest, wrecked
from taichi_soft import LAWS, sphere
from taichi_soft.core.errors import OptionError
from taichi_soft.core.math.rotations import matrix_of

pytestmark = pytest.mark.soak

SOUND = Ending(tets=40, failure=None, is_finite=True, flipped=0, speed=6.0, fastest=6.3)
PLAIN = {
    "group": "own",
    "name": "a test",
    "mesh": "sphere 2",
    **USUAL,
    "law": None,
    "flips": None,
    "damping": "default",
}


@pytest.mark.parametrize(
    ("ending", "verdict"),
    [
        (SOUND, Verdict.OK),
        (replace(SOUND, flipped=1), Verdict.INVERTED),
        (replace(SOUND, speed=10.0), Verdict.RUNAWAY),
        (replace(SOUND, fastest=inf, distance=0.009), Verdict.OK),
        (replace(SOUND, fastest=inf, distance=0.011), Verdict.MISSHAPEN),
        (replace(SOUND, flipped=3, distance=0.2), Verdict.INVERTED),
        (replace(SOUND, failure="at 0.6 s", flipped=3), Verdict.FROZEN),
        (replace(SOUND, is_finite=False, speed=inf), Verdict.FROZEN),
    ],
)
def test_an_ending_is_judged_by_the_worst_of_it(ending, verdict):
    found, reason = judge(ending)
    assert found is verdict
    assert bool(reason) == (verdict is not Verdict.OK)


def test_every_body_meets_every_law_on_tetrahedra_and_damping():
    cells = choose_cells()
    bodies = {name: len(list(make())) for name, make in GROUPS.items()}
    assert {"own": 36, "cells": 153, "wrecked": 90}.items() <= bodies.items()
    assert bodies["foreign"] >= 45
    variants = law_variants()
    assert {law for law, _ in variants[1:]} == {"virial", "face", "st_venant_kirchhoff", "neo_hookean"}
    assert {(law, flips) for law, flips in variants[1:] if law == "face"} == {
        ("face", flips.value) for flips in LAWS["face"].flips
    }
    for group, count in bodies.items():
        by_default = [cell for cell in cells if cell["group"] == group and cell["law"] is None]
        assert len(by_default) == len({cell["name"] for cell in by_default}) == count
    assert cells == json.loads(json.dumps(cells))
    assert len({json.dumps(cell) for cell in cells}) == len(cells)
    grid = [cell for cell in cells if cell["group"] == "cells"]
    for axis, values in AXES.items():
        assert {cell[axis] for cell in grid} == set(values)


def test_a_part_of_the_sweep_can_be_chosen():
    few = choose_cells(["own", "cells"], law="virial", flips="recover", damping="none", count=5)
    assert [cell["group"] for cell in few] == ["own"] * 5 + ["cells"] * 5
    assert {(cell["law"], cell["flips"], cell["damping"]) for cell in few} == {("virial", "recover", "none")}
    more = choose_cells(["own", "cells"], law="virial", flips="recover", damping="none", count=20)
    assert all(cell in more for cell in few)  # results of a smaller sample are reused
    wrecks = choose_cells(["wrecked"], law="default", wrecks=7)
    assert [cell["group"] for cell in wrecks].count("random wrecks") == 7
    assert wrecks == choose_cells(["wrecked"], law="default", wrecks=7)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"groups": ["none"]}, "'none'"),
        ({"law": "springs"}, "'springs'"),
        ({"law": "neo_hookean", "flips": "off"}, "'off'"),
        ({"damping": "much"}, "'much'"),
    ],
)
def test_what_is_not_known_is_refused_by_name(options, named):
    with pytest.raises(OptionError, match=named):
        choose_cells(**options)


@pytest.mark.parametrize("wreck", WRECKS)
def test_a_wreck_is_no_shape_to_live_in_and_the_same_every_time(wreck):
    rest = sphere(0.5, 2).vertices
    start = wrecked(rest, wreck, 1)
    np.testing.assert_array_equal(start, wrecked(rest, wreck, 1))
    assert np.abs(start).max() < 1.0
    assert distance_from_rest(rest, start, np.ones(len(rest))) > 0.1


def test_distance_from_rest_leaves_rigid_motion_out_and_nothing_else():
    rng = np.random.default_rng(5)
    rest, masses = rng.normal(size=(50, 3)), rng.uniform(0.5, 2.0, 50)
    quaternion = rng.normal(size=4)
    turn = matrix_of(quaternion / np.linalg.norm(quaternion))
    moved = rest @ turn.T + (3.0, -2.0, 9.0)
    assert distance_from_rest(rest, moved, masses) < 1e-12
    about = rest - masses @ rest / masses.sum()
    radius = np.sqrt(masses @ (about**2).sum(axis=1) / masses.sum())
    size = np.ptp(rest, axis=0).max()
    assert distance_from_rest(rest, 1.02 * moved, masses) == pytest.approx(0.02 * radius / size)
    assert distance_from_rest(rest, rest * (1, 1, -1), masses) > 0.1


def test_cells_that_cannot_be_tried_say_why():
    slow = run_cell({**PLAIN, "young": 1e9, "scale": 0.01})
    assert slow["verdict"] == "too slow"
    assert slow["substeps"] > 500
    assert f"{slow['substeps']} substeps for 1/60 s" in slow["reason"]
    tolerant = {"law": "virial", "flips": "tolerant"}  # turns nothing back
    soft = run_cell({**PLAIN, **tolerant, "mesh": "sphere 4", "young": 1e4, "scale": 10.0})
    assert soft["verdict"] == "too soft"
    assert "inside out at the end; when it was built: a body is too soft for its weight" in soft["reason"]
    refused = run_cell({**PLAIN, "poisson": 0.5})
    assert refused["verdict"] == "refused"
    assert "MaterialError" in refused["reason"]


def test_a_stiff_ball_is_fine_a_mirrored_one_stays_so_and_one_without_flips_freezes():
    """A mirrored tetrahedron is at rest for tolerant flips; without, nothing holds one."""
    fine = run_cell({**PLAIN, "young": 1e7, "damping": "edges 0.2"})
    assert (fine["verdict"], fine["reason"], fine["tets"]) == ("ok", "", 160)
    assert fine["mach"] == pytest.approx(np.sqrt(2 * 9.81 * 2) / 100, rel=1e-3)  # sound at 100 m/s
    assert fine["sag"] == pytest.approx(1000 * 9.81 / 1e7, rel=0.06)
    virial = {**PLAIN, "law": "virial", "damping": "edges 0.2"}
    mirrored = run_cell({**virial, "flips": "tolerant", "wreck": "inside out"})
    assert mirrored["verdict"] == "inverted"
    assert mirrored["reason"].startswith("160 of 160 tetrahedra")
    frozen = run_cell({**virial, "flips": "off", "wreck": "scrambled"})
    assert frozen["verdict"] == "frozen"
    assert "first tetrahedron" in frozen["reason"]
    back = run_cell({**virial, "flips": "recover", "wreck": "inside out"})
    assert (back["verdict"], back["reason"]) == ("ok", "")
