"""Methods I and II: equal forces. Times are given, and only the conclusions from them are tested."""

import copy

import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Result, Results, Verdict, section_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["methods-cost"]
COST = {
    "seconds": {"virial": [4e-5] * 3, "face": [4.1e-5] * 3, "springs": [2e-5] * 3, "cmpm": [1e-5] * 3},
    **{"tets": 100, "edges": 140, "corners": 600},
}


def verdicts(forces, cost):
    rows = [Result({"kind": "forces"}, forces), Result({"kind": "cost"}, cost)]
    return {f.claim: f.verdict for f in section_of(EXPERIMENT, Results(tuple(rows))).findings}


def test_both_methods_give_the_same_forces_flips_included():
    numbers = quick_results(EXPERIMENT.name).one(kind="forces")
    assert numbers["difference"] < 1e-12
    assert 0.05 < numbers["flipped"] / numbers["looked_at"] < 0.5  # half of those that are shaken most
    assert verdicts(numbers, COST)["methods-alike"] is Verdict.AGREES
    assert verdicts({**numbers, "difference": 1e-3}, COST)["methods-alike"] is Verdict.DIFFERS


def test_times_decide():
    forces = {"difference": 1e-15, "flipped": 1, "looked_at": 10}
    assert set(verdicts(forces, COST).values()) == {Verdict.AGREES}
    slow = copy.deepcopy(COST)
    slow["seconds"]["cmpm"] = [2e-4] * 3
    assert verdicts(forces, slow)["springs-faster"] is Verdict.PARTLY
    slow["seconds"]["springs"] = [4e-5] * 3
    slow["seconds"]["face"] = [9e-5] * 3
    assert set(verdicts(forces, slow).values()) == {Verdict.DIFFERS}


def test_a_time_is_measured_for_each_law():
    numbers = EXPERIMENT.measure({"kind": "cost", "cells": 2, "repeats": 3})
    assert numbers["tets"] == 40
    assert all(len(times) == 3 and min(times) > 0 for times in numbers["seconds"].values())
