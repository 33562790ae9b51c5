"""Experiments: those of the thesis, and checks against theory, one file per figure or claim."""

from taichi_soft.experiments.beams import BEAMS
from taichi_soft.experiments.claims import CLAIMS, Claim
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
from taichi_soft.experiments.finite_elements import FINITE_ELEMENTS
from taichi_soft.experiments.leapfrog_reversal import REVERSAL
from taichi_soft.experiments.mesh_convergence import CONVERGENCE

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment for experiment in (REVERSAL, BEAMS, FINITE_ELEMENTS, CONVERGENCE)
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
