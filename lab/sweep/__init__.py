"""Compute points in processes of this machine, and store each result immediately.

Points and results are plain data. This package does not interpret the data.
"""

from lab.sweep.progress import show_progress
from lab.sweep.provenance import origin
from lab.sweep.schedule import TIME_LIMIT, compute_all
from lab.sweep.store import Store, SweepError
from lab.sweep.task import Outcome, Task

__all__ = [
    "TIME_LIMIT",
    "Outcome",
    "Store",
    "SweepError",
    "Task",
    "compute_all",
    "origin",
    "show_progress",
]
