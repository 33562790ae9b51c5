"""Experiments of the thesis and checks against theory, one file per figure or claim."""

from lab.experiments.anisotropy import ANISOTROPY
from lab.experiments.bars_bounce import BARS_BOUNCE
from lab.experiments.beams import BEAMS
from lab.experiments.best_fitting_plane_cost import BEST_FITTING_PLANE_COST
from lab.experiments.claims import CLAIMS, Claim
from lab.experiments.cmpm2_step import CMPM2_STEP
from lab.experiments.cylinder_forces import CYLINDER_FORCES
from lab.experiments.cylinder_stretch import CYLINDER_STRETCH
from lab.experiments.damping_rotation import DAMPING_ROTATION
from lab.experiments.density_bounce import DENSITY_BOUNCE
from lab.experiments.dynamics import (
    ENERGY_BUDGET,
    FREQUENCIES,
    HERTZ,
    MOMENTUM_BUDGET,
    WAVE_SPEED,
)
from lab.experiments.energy_drift import ENERGY_DRIFT
from lab.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    MissingPointError,
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
from lab.experiments.fig_3_1 import FIG_3_1
from lab.experiments.fig_3_2 import FIG_3_2
from lab.experiments.fig_3_3 import FIG_3_3
from lab.experiments.fig_4_3 import FIG_4_3
from lab.experiments.fig_4_5 import FIG_4_5
from lab.experiments.fig_4_7 import FIG_4_7
from lab.experiments.finite_elements import FINITE_ELEMENTS
from lab.experiments.flips_dent import FLIPS_DENT
from lab.experiments.implicit_step import IMPLICIT_STEP
from lab.experiments.implicit_tetrahedra import IMPLICIT_TETRAHEDRA
from lab.experiments.integrator_orders import INTEGRATOR_ORDERS
from lab.experiments.large_strain import LARGE_STRAIN
from lab.experiments.leapfrog_reversal import REVERSAL
from lab.experiments.linear_strain import LINEAR_STRAIN
from lab.experiments.mesh_convergence import CONVERGENCE
from lab.experiments.mesh_quality import MESH_QUALITY
from lab.experiments.methods_cost import METHODS_COST
from lab.experiments.patch_test import PATCH_TEST
from lab.experiments.refresh_rate import REFRESH_RATE
from lab.experiments.shear_modulus_volume import SHEAR_MODULUS_VOLUME
from lab.experiments.size_acceleration import SIZE_ACCELERATION
from lab.experiments.sphere_real_time import SPHERE_REAL_TIME
from lab.experiments.stability_map import STABILITY_MAP
from lab.experiments.tilted_plane import TILTED_PLANE
from lab.experiments.volume_springs_limit import VOLUME_SPRINGS_LIMIT
from lab.experiments.volume_springs_shear import VOLUME_SPRINGS_SHEAR

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
        SHEAR_MODULUS_VOLUME,
        VOLUME_SPRINGS_SHEAR,
        VOLUME_SPRINGS_LIMIT,
        CYLINDER_FORCES,
        CYLINDER_STRETCH,
        LINEAR_STRAIN,
        LARGE_STRAIN,
        METHODS_COST,
        IMPLICIT_TETRAHEDRA,
        SIZE_ACCELERATION,
        ENERGY_DRIFT,
        DAMPING_ROTATION,
        STABILITY_MAP,
        MESH_QUALITY,
        SPHERE_REAL_TIME,
        REFRESH_RATE,
        BARS_BOUNCE,
        FLIPS_DENT,
        DENSITY_BOUNCE,
        PATCH_TEST,
        FINITE_ELEMENTS,
        BEAMS,
        CONVERGENCE,
        FREQUENCIES,
        WAVE_SPEED,
        HERTZ,
        ENERGY_BUDGET,
        MOMENTUM_BUDGET,
    )
}
"""Experiments by name, in the order of the report."""

__all__ = [
    "CLAIMS",
    "EXPERIMENTS",
    "Claim",
    "Effort",
    "Experiment",
    "Finding",
    "MissingPointError",
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
