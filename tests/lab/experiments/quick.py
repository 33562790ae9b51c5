"""Run experiments for tests: measure all points of a quick report once, and return the findings by claim."""

import copy
import json
import tempfile
from contextlib import closing
from functools import cache
from pathlib import Path

from lab.experiments import EXPERIMENTS, Effort, Result, Results, section_of
from lab.sweep import Outcome, Store, origin


@cache
def quick_folder():
    """Return the folder in which `python -m lab report --quick --out` finds the results of these tests."""
    kept = tempfile.TemporaryDirectory(prefix="taichi-soft-quick-")
    quick_folder.kept = kept  # until this process ends
    return Path(kept.name)


@cache
def _measured(name):
    experiment = EXPERIMENTS[name]
    rows = []
    with closing(Store(quick_folder() / "data" / f"{name}.jsonl", origin("cpu"))) as store:
        for point in experiment.points(Effort.QUICK):
            numbers = json.loads(json.dumps(experiment.measure(point)))
            store.keep(point, Outcome(numbers))
            rows.append(Result(point, numbers))
    return Results(tuple(rows))


def quick_results(name):
    """Return a copy of an experiment's results that the caller may change."""
    return copy.deepcopy(_measured(name))


def findings(name, results):
    """Return the findings of an experiment by claim, one for each of its claims."""
    found = section_of(EXPERIMENTS[name], results).findings
    assert [finding.claim for finding in found] == list(EXPERIMENTS[name].claims)
    return {finding.claim: finding for finding in found}


def verdicts(name, results):
    """Return the verdicts of an experiment by claim."""
    return {claim: finding.verdict for claim, finding in findings(name, results).items()}


def altered(results, change):
    """Return a copy of the results after `change(point, numbers)` for each."""
    return Results(tuple(Result(row.point, change(row.point, dict(row.numbers))) for row in results.rows))
