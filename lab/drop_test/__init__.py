"""Random bodies dropped onto random courses: what breaks, and how often."""

from lab.drop_test.case import Case, make_case
from lab.drop_test.outcome import Outcome
from lab.drop_test.summary import Summary
from lab.drop_test.trial import run_cases

__all__ = ["Case", "Outcome", "Summary", "make_case", "run_cases"]
