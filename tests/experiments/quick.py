"""Experiments run for tests: all points at quick effort, and their findings by claim."""

from taichi_soft.experiments import EXPERIMENTS, Effort, Result, Results, section_of


def quick_results(name):
    """Results of the experiment of that name."""
    experiment = EXPERIMENTS[name]
    return Results(tuple(Result(p, experiment.measure(p)) for p in experiment.points(Effort.QUICK)))


def findings(name, results):
    """Its findings by claim, one for each that it names."""
    found = section_of(EXPERIMENTS[name], results).findings
    assert [finding.claim for finding in found] == list(EXPERIMENTS[name].claims)
    return {finding.claim: finding for finding in found}


def verdicts(name, results):
    """Its verdicts by claim."""
    return {claim: finding.verdict for claim, finding in findings(name, results).items()}


def altered(results, change):
    """The results with `change(point, numbers)` made of each."""
    return Results(tuple(Result(row.point, change(row.point, dict(row.numbers))) for row in results.rows))
