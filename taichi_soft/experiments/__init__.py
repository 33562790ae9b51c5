"""Experiments: those of the thesis, and checks against theory, one file per figure or claim."""

from taichi_soft.experiments.anisotropy import ANISOTROPY
from taichi_soft.experiments.best_fitting_plane_cost import BEST_FITTING_PLANE_COST
from taichi_soft.experiments.claims import CLAIMS, Claim
from taichi_soft.experiments.cmpm2_step import CMPM2_STEP
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
from taichi_soft.experiments.fig_3_1 import FIG_3_1
from taichi_soft.experiments.fig_3_2 import FIG_3_2
from taichi_soft.experiments.fig_3_3 import FIG_3_3
from taichi_soft.experiments.fig_4_3 import FIG_4_3
from taichi_soft.experiments.fig_4_5 import FIG_4_5
from taichi_soft.experiments.fig_4_7 import FIG_4_7
from taichi_soft.experiments.implicit_step import IMPLICIT_STEP
from taichi_soft.experiments.integrator_orders import INTEGRATOR_ORDERS
from taichi_soft.experiments.leapfrog_reversal import REVERSAL
from taichi_soft.experiments.tilted_plane import TILTED_PLANE

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        FIG_3_1,
        FIG_3_2,
        FIG_3_3,
        REVERSAL,
        INTEGRATOR_ORDERS,
        IMPLICIT_STEP,
        FIG_4_3,
        FIG_4_5,
        ANISOTROPY,
        CMPM2_STEP,
        FIG_4_7,
        BEST_FITTING_PLANE_COST,
        TILTED_PLANE,
    )
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
