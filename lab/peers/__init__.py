"""One drop here, in other engines, and in a fine reference: cost and error of each."""

from lab.peers.comparison import Entry, compare, missing_peers
from lab.peers.drop import Drop
from lab.peers.drop_measures import measure
from lab.peers.registry import PEERS
from lab.peers.trajectory import Trajectory

__all__ = ["PEERS", "Drop", "Entry", "Trajectory", "compare", "measure", "missing_peers"]
