"""Points computed in processes of this machine or on a cluster, and kept as soon as they are there.

A point is plain data, and so is what a function measures there. Nothing here knows what either is about.
"""

from lab.sweep.cluster import cluster_workers
from lab.sweep.progress import show_progress
from lab.sweep.provenance import origin
from lab.sweep.schedule import TIME_LIMIT, compute_all
from lab.sweep.store import Store
from lab.sweep.task import Outcome, Task, Worker
from lab.sweep.workers import local_workers

__all__ = [
    "TIME_LIMIT",
    "Outcome",
    "Store",
    "Task",
    "Worker",
    "cluster_workers",
    "compute_all",
    "local_workers",
    "origin",
    "show_progress",
]
