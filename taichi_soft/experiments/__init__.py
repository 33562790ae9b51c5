"""Experiments: those of the thesis, and checks against theory, one file per figure or claim."""

from taichi_soft.experiments.claims import CLAIMS, Claim
from taichi_soft.experiments.cylinder_forces import CYLINDER_FORCES
from taichi_soft.experiments.cylinder_stretch import CYLINDER_STRETCH
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
from taichi_soft.experiments.linear_strain import LINEAR_STRAIN
from taichi_soft.experiments.methods_cost import METHODS_COST
from taichi_soft.experiments.patch_test import PATCH_TEST
from taichi_soft.experiments.shear_modulus_volume import SHEAR_MODULUS_VOLUME
from taichi_soft.experiments.volume_springs_limit import VOLUME_SPRINGS_LIMIT
from taichi_soft.experiments.volume_springs_shear import VOLUME_SPRINGS_SHEAR

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        REVERSAL,
        SHEAR_MODULUS_VOLUME,
        VOLUME_SPRINGS_SHEAR,
        VOLUME_SPRINGS_LIMIT,
        CYLINDER_STRETCH,
        CYLINDER_FORCES,
        METHODS_COST,
        LINEAR_STRAIN,
        PATCH_TEST,
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
