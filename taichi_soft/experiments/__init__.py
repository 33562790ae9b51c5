"""Experiments: those of the thesis, and checks against theory, one file per figure or claim."""

from taichi_soft.experiments.bars_bounce import BARS_BOUNCE
from taichi_soft.experiments.claims import CLAIMS, Claim
from taichi_soft.experiments.damping_rotation import DAMPING_ROTATION
from taichi_soft.experiments.density_bounce import DENSITY_BOUNCE
from taichi_soft.experiments.energy_drift import ENERGY_DRIFT
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
from taichi_soft.experiments.flips_dent import FLIPS_DENT
from taichi_soft.experiments.leapfrog_reversal import REVERSAL
from taichi_soft.experiments.mesh_quality import MESH_QUALITY
from taichi_soft.experiments.sphere_real_time import SPHERE_REAL_TIME
from taichi_soft.experiments.stability_map import STABILITY_MAP

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        REVERSAL,
        ENERGY_DRIFT,
        DAMPING_ROTATION,
        STABILITY_MAP,
        MESH_QUALITY,
        SPHERE_REAL_TIME,
        BARS_BOUNCE,
        FLIPS_DENT,
        DENSITY_BOUNCE,
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
