"""One drop here, in other engines, and in a fine reference: cost and error of each."""

from lab.peers.comparison import Entry, compare, missing_peers
from lab.peers.course import Course
from lab.peers.drop import Drop
from lab.peers.measures import measure
from lab.peers.registry import PEERS

__all__ = ["PEERS", "Course", "Drop", "Entry", "compare", "measure", "missing_peers"]
