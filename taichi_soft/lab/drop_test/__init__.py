"""Random bodies dropped onto random courses: what breaks, and how often."""

from taichi_soft.lab.drop_test.case import Case, make_case
from taichi_soft.lab.drop_test.outcome import Outcome
from taichi_soft.lab.drop_test.summary import Summary
from taichi_soft.lab.drop_test.trial import run_cases

__all__ = ["Case", "Outcome", "Summary", "make_case", "run_cases"]
