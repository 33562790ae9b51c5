"""Points computed in processes of this machine or on a cluster, and kept as soon as they are there.

A point is plain data, and so is what a function measures there. Nothing here knows what either is about.
"""

from taichi_soft.lab.sweep.cluster import cluster_workers
from taichi_soft.lab.sweep.progress import show_progress
from taichi_soft.lab.sweep.provenance import origin
from taichi_soft.lab.sweep.schedule import TIME_LIMIT, compute_all
from taichi_soft.lab.sweep.store import Store
from taichi_soft.lab.sweep.task import Outcome, Task, Worker
from taichi_soft.lab.sweep.workers import local_workers

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
