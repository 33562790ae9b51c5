"""Points computed in processes of this machine, and kept as soon as they are there.

A point is plain data, and so is what a function measures there. Nothing here knows what either is about.
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
