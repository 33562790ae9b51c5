"""Measure and judge the library: experiments, report, sweeps, drop test, other engines.

Only a checkout has it; wheels do not. It imports `taichi_soft`, which does not import it. Its command line is
`python -m lab`.
"""
