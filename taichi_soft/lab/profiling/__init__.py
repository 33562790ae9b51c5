"""What a frame costs: measured, never guessed."""

from taichi_soft.lab.profiling.baseline import Baseline, compile_baseline, find_compiler
from taichi_soft.lab.profiling.budget import Budget, measure_budget
from taichi_soft.lab.profiling.comparison import Comparison, compare_with_baseline
from taichi_soft.lab.profiling.crossover import Crossover, measure_crossover
from taichi_soft.lab.profiling.devices import DeviceGain, measure_devices
from taichi_soft.lab.profiling.game import (
    FeatureCost,
    Heap,
    Moments,
    measure_features,
    measure_heaps,
    measure_moments,
)
from taichi_soft.lab.profiling.implicit import ImplicitGain, measure_implicit
from taichi_soft.lab.profiling.kept_budget import KeptBudget, measure_kept_budget
from taichi_soft.lab.profiling.law_costs import LawCost, measure_laws
from taichi_soft.lab.profiling.phases import Phases, measure_phases
from taichi_soft.lab.profiling.scaling import Scaling, measure_scaling
from taichi_soft.lab.profiling.spread import Spread
from taichi_soft.lab.profiling.startup import Startup, measure_startup

__all__ = [
    "Baseline",
    "Budget",
    "Comparison",
    "Crossover",
    "DeviceGain",
    "FeatureCost",
    "Heap",
    "ImplicitGain",
    "KeptBudget",
    "LawCost",
    "Moments",
    "Phases",
    "Scaling",
    "Spread",
    "Startup",
    "compare_with_baseline",
    "compile_baseline",
    "find_compiler",
    "measure_budget",
    "measure_crossover",
    "measure_devices",
    "measure_features",
    "measure_heaps",
    "measure_implicit",
    "measure_kept_budget",
    "measure_laws",
    "measure_moments",
    "measure_phases",
    "measure_scaling",
    "measure_startup",
]
