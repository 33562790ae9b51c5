"""Measure the time of a frame."""

from taichi_soft.profiling.baseline import compile_baseline, find_compiler
from taichi_soft.profiling.budget import measure_budget
from taichi_soft.profiling.comparison import compare_with_baseline
from taichi_soft.profiling.crossover import measure_crossover
from taichi_soft.profiling.devices import measure_devices
from taichi_soft.profiling.feature_costs import measure_features, measure_heaps, measure_moments
from taichi_soft.profiling.implicit import measure_implicit
from taichi_soft.profiling.kept_budget import measure_kept_budget
from taichi_soft.profiling.law_costs import LawCost, measure_laws
from taichi_soft.profiling.scaling import measure_scaling
from taichi_soft.profiling.spread import Spread
from taichi_soft.profiling.startup import measure_startup

__all__ = [
    "LawCost",
    "Spread",
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
    "measure_scaling",
    "measure_startup",
]
