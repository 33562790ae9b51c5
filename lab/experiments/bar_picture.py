"""Image of loaded bars with exaggerated displacements."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lab.experiments.bar_stiffness import WIDTH
from lab.experiments.irregular_block import irregular_block
from taichi_soft.render import Camera, Renderer, Surface, colormap, draw_labels

SIZE = (960, 540)
"""Width and height of the image [pixels]."""


def bar_picture(
    length: float, cells: int, displacements: dict[str, ArrayLike], factor: float
) -> NDArray[np.uint8]:
    """Draw bars in two columns.

    Colours show the displacement of each vertex as a fraction of the bar's largest displacement.
    Args:
        length, cells: as in `irregular_block`.
        displacements: displacements of the vertices, (n, 3) [m], by name of the bar.
        factor: factor by which the displacements are exaggerated.
    Returns: RGB (sRGB), uint8 (height, width, 3).
    """
    mesh = irregular_block(length, WIDTH, cells)
    apart = 2.2 * WIDTH
    surfaces, places = [], []
    for row, moved in enumerate(displacements.values()):
        u = np.asarray(moved, float)
        place = np.array([(row % 2) * 1.35 * length, 0.0, -(row // 2) * apart])
        surface = Surface.of(mesh)
        surface.positions = mesh.vertices + factor * u + place
        size = np.linalg.norm(u, axis=1)
        surface.color = colormap(size, 0.0, float(size.max()))
        surfaces.append(surface)
        places.append(place)
    centres = np.array(places)
    room = np.array([length, WIDTH, 2 * WIDTH]) / 2
    below = room + np.array([0.0, 0.0, 0.6 * WIDTH])
    camera = Camera.framing(
        centres.min(axis=0) - below, centres.max(axis=0) + room, azimuth=-80, aspect=SIZE[0] / SIZE[1]
    )
    image = Renderer(*SIZE, camera=camera, floor=None).render(surfaces)
    above = centres + np.array([0.0, 0.0, 1.3 * WIDTH])  # captions are drawn below these points
    return draw_labels(image, list(displacements), camera.project(above, *SIZE))
