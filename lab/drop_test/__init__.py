"""Drop random bodies onto random courses, and count the failures."""

from lab.drop_test.case import make_case
from lab.drop_test.case_runs import run_cases
from lab.drop_test.summary import Summary

__all__ = ["Summary", "make_case", "run_cases"]
