"""Images of bodies for a section, drawn from measured positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing import TetMesh
from taichi_soft.render import (
    PALETTE,
    Camera,
    Corner,
    Renderer,
    Surface,
    colormap,
    draw_labels,
    draw_text,
)


def picture(
    bodies: Sequence[tuple[TetMesh, ArrayLike]],
    floor: bool,
    size: tuple[int, int] = (640, 400),
    values: Sequence[ArrayLike] | None = None,
    *,
    limits: tuple[float, float] | None = None,
    quantity: str = "",
    labels: Sequence[str] = (),
    azimuth: float = -60.0,
    elevation: float = 18.0,
) -> NDArray[np.uint8]:
    """Draw bodies with a camera that is just far enough away to show all of them.

    Args:
        bodies: meshes and the positions of all their vertices, (n, 3) [m], finite.
        floor: True to draw a floor at z = 0, or below the lowest vertex if that is lower.
        size: width and height [pixels].
        values: a number per vertex for each body, (n,), shown from violet (low) to yellow (high).
        limits: values of violet and yellow; None for the smallest and the largest value.
        quantity: name and unit of the values, such as "strain [1]", written into the image with the limits.
        labels: caption below each body, plain ASCII.
        azimuth, elevation: direction of the camera, see `Camera.framing` [degrees].
    Returns: RGB (sRGB), uint8 (height, width, 3).
    Raises: OptionError for positions that are not finite, or a wrong number of values or labels.
    """
    if not bodies:
        raise OptionError("a picture needs at least one body")
    places = [as_array(positions, "positions", (len(mesh.vertices), 3), "m") for mesh, positions in bodies]
    surfaces = [Surface.of(mesh, color=PALETTE[k % len(PALETTE)]) for k, (mesh, _) in enumerate(bodies)]
    for surface, rows in zip(surfaces, places, strict=True):
        surface.positions = rows
    low, high = _colour(surfaces, values, limits)
    lower = np.min([rows.min(axis=0) for rows in places], axis=0)
    upper = np.max([rows.max(axis=0) for rows in places], axis=0)
    ground = min(0.0, float(lower[2]))
    if floor:
        lower[2] = ground
    width, height = size
    camera = Camera.framing(
        lower,
        upper,
        azimuth=azimuth,
        elevation=elevation,
        aspect=width / height,
        margin=1.3 if quantity else 1.15,
    )
    renderer = Renderer(width, height, camera=camera, floor=ground if floor else None)
    image = renderer.render(surfaces)
    if labels:
        feet = np.array([rows.mean(axis=0) for rows in places])
        feet[:, 2] = [rows[:, 2].min() for rows in places]
        draw_labels(image, list(labels), camera.project(feet, width, height))
    if values is not None and quantity:
        draw_text(image, [f"{quantity}: violet {low:.3g}, yellow {high:.3g}"], corner=Corner.TOP_LEFT)
    return image


def _colour(
    surfaces: Sequence[Surface], values: Sequence[ArrayLike] | None, limits: tuple[float, float] | None
) -> tuple[float, float]:
    """Colour the surfaces by their values on one scale. Returns: the ends of the scale."""
    if values is None:
        return 0.0, 0.0
    if len(values) != len(surfaces):
        raise OptionError(f"there are {len(surfaces)} bodies and values of {len(values)}")
    rows = [
        as_array(numbers, "values", (surface.vertex_count,))
        for surface, numbers in zip(surfaces, values, strict=True)
    ]
    low, high = limits or (min(float(row.min()) for row in rows), max(float(row.max()) for row in rows))
    top = high if high > low else low + max(abs(low), 1.0)  # equal values are all violet
    for surface, row in zip(surfaces, rows, strict=True):
        surface.color = colormap(row, low, top)
    return low, high
