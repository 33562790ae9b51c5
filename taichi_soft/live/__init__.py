"""Show a live world in a browser, where visitors can grab bodies and change parameters."""

from taichi_soft.live.choices import choices
from taichi_soft.live.stress_table import StressRow, StressTable, stress_table
from taichi_soft.live.viewing import View, view

__all__ = ["StressRow", "StressTable", "View", "choices", "stress_table", "view"]
