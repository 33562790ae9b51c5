"""The same drop here, in other engines, and in a fine reference: what each costs, and how far off it is."""

from taichi_soft.lab.peers.comparison import Entry, compare, missing_peers
from taichi_soft.lab.peers.course import Course
from taichi_soft.lab.peers.drop import Drop
from taichi_soft.lab.peers.measures import Outcome, measure
from taichi_soft.lab.peers.registry import PEERS, Peer

__all__ = ["PEERS", "Course", "Drop", "Entry", "Outcome", "Peer", "compare", "measure", "missing_peers"]
