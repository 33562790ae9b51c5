"""Random bodies dropped onto random courses: which failures occur, and how often."""

from lab.drop_test.case import make_case
from lab.drop_test.summary import Summary
from lab.drop_test.trial import run_cases

__all__ = ["Summary", "make_case", "run_cases"]
