"""Render images and films of soft bodies without a display."""

from taichi_soft.render.camera import Camera
from taichi_soft.render.colors import FLIPPED, PALETTE, ColorScale, colormap, highlight
from taichi_soft.render.drawn_surface import Surface
from taichi_soft.render.look import Look
from taichi_soft.render.overlay import Corner, draw_color_scale, draw_labels, draw_legend, draw_text
from taichi_soft.render.renderer import Renderer
from taichi_soft.render.texture import Texture
from taichi_soft.render.video import VideoWriter

__all__ = [
    "FLIPPED",
    "PALETTE",
    "Camera",
    "ColorScale",
    "Corner",
    "Look",
    "Renderer",
    "Surface",
    "Texture",
    "VideoWriter",
    "colormap",
    "draw_color_scale",
    "draw_labels",
    "draw_legend",
    "draw_text",
    "highlight",
]
