"""Random bodies dropped onto random courses: what breaks, and how often."""

from taichi_soft.drops.case import Case, make_case
from taichi_soft.drops.outcome import Outcome
from taichi_soft.drops.summary import Summary
from taichi_soft.drops.trial import run_cases

__all__ = ["Case", "Outcome", "Summary", "make_case", "run_cases"]
