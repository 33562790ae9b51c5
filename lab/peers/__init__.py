"""Cost and error of one drop in taichi-soft and in other engines, compared with a fine reference."""

from lab.peers.comparison import Entry, compare, missing_peers
from lab.peers.drop import Drop
from lab.peers.drop_measures import measure
from lab.peers.registry import PEERS
from lab.peers.trajectory import Trajectory

__all__ = ["PEERS", "Drop", "Entry", "Trajectory", "compare", "measure", "missing_peers"]
