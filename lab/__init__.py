"""Measure and judge the library: experiments, report, sweeps, drop test, comparison with other engines.

Only a checkout contains this package; wheels do not. `lab` imports `taichi_soft`, but `taichi_soft` does not
import `lab`. The command line of `lab` is `python -m lab`.
"""
