"""A world live in a browser: seen, touched and tuned."""

from taichi_soft.live.choices import choices
from taichi_soft.live.viewing import View, view

__all__ = ["View", "choices", "view"]
