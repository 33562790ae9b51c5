"""Experiments: those of the thesis, and checks against theory, one file per figure or claim."""

from taichi_soft.experiments.claims import CLAIMS, Claim
from taichi_soft.experiments.dynamics import ENERGY_BUDGET, FREQUENCIES, HERTZ, MOMENTUM_BUDGET, WAVE_SPEED
from taichi_soft.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    MissingPointError,
    Numbers,
    Picture,
    Plot,
    Point,
    Result,
    Results,
    Section,
    Table,
    Verdict,
    section_of,
)
from taichi_soft.experiments.leapfrog_reversal import REVERSAL

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (REVERSAL, FREQUENCIES, WAVE_SPEED, HERTZ, ENERGY_BUDGET, MOMENTUM_BUDGET)
}
"""By name, in the order of the report."""

__all__ = [
    "CLAIMS",
    "EXPERIMENTS",
    "Claim",
    "Effort",
    "Experiment",
    "Finding",
    "MissingPointError",
    "Numbers",
    "Picture",
    "Plot",
    "Point",
    "Result",
    "Results",
    "Section",
    "Table",
    "Verdict",
    "section_of",
]
