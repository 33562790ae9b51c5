"""Pictures and films of soft bodies without a display."""

# ruff: noqa: E402 (says first which package is missing)

from taichi_soft.core.extras import require_extra

require_extra("film", "pictures and films need")

# isort: split
from taichi_soft.render.camera import Camera
from taichi_soft.render.colors import FLIPPED, PALETTE, colormap, highlight
from taichi_soft.render.overlay import Corner, draw_labels, draw_text
from taichi_soft.render.renderer import Renderer
from taichi_soft.render.surface import Surface
from taichi_soft.render.video import VideoWriter

__all__ = [
    "FLIPPED",
    "PALETTE",
    "Camera",
    "Corner",
    "Renderer",
    "Surface",
    "VideoWriter",
    "colormap",
    "draw_labels",
    "draw_text",
    "highlight",
]
