"""Measure and judge the library: experiments, report, sweeps, drop test, comparison with other engines.

Only a checkout contains this package; wheels do not. It imports `taichi_soft`, which does not import it. Its
command line is `python -m lab`.
"""
