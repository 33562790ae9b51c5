"""A world live in a browser: seen, touched and tuned."""

from taichi_soft.live.choices import choices

__all__ = ["choices"]
