"""Surfaces of colliders, and of props that move with a collider or a frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.collider import Collider
from taichi_soft.contact.shapes import HeightFieldShape, PlaneShape, Shape
from taichi_soft.contact.shapes.shape import Triangles
from taichi_soft.control.frames import Frame
from taichi_soft.core.math.rotations import matrix_of, quaternion_of, rotation_vector, turned_by
from taichi_soft.render import Surface
from taichi_soft.render.colors import Color
from taichi_soft.world.world import World

SLATE: Color = (0.33, 0.39, 0.50)
"""Colour of colliders, sRGB from 0 to 1: darker than the floor and less saturated than any body."""


@dataclass(frozen=True)
class Prop:
    """A solid object drawn at a collider or a frame, such as a hand or a hook.

    Args:
        surface: vertices and triangles in the frame of `place`, in the form that `Shape.surface` returns.
        place: collider or frame with which the prop moves.
        color: sRGB from 0 to 1.
    """

    surface: Triangles
    place: Collider | Frame
    color: Color = SLATE


class Scenery:
    """Surfaces of all colliders of a world except its floor, and surfaces of props.

    The surfaces are interpolated between the last two steps, like bodies. Call `remember` before each step.
    """

    def __init__(
        self, world: World, props: Sequence[Prop] = (), colors: Mapping[Collider, Color] | None = None
    ) -> None:
        """Make the surfaces. `colors` contains the colours of highlighted colliders, sRGB from 0 to 1."""
        given = colors or {}
        drawn = [each for each in world.colliders if is_drawn(each)]
        seen = [Prop(drawn_surface(each.shape), each, given.get(each, SLATE)) for each in drawn]
        self._props = [*seen, *props]
        self._surfaces = [Surface(*prop.surface, color=prop.color) for prop in self._props]
        self._before: list[Any] = []
        self.remember()

    def remember(self) -> None:
        """Store the poses of all colliders and props before a step."""
        self._before = [_pose(prop) for prop in self._props]

    def at(self, alpha: float) -> list[Surface]:
        """Return the surfaces, interpolated between the stored poses (`alpha` 0) and the current ones (1)."""
        for prop, surface, (start, turn) in zip(self._props, self._surfaces, self._before, strict=True):
            end, last_turn = _pose(prop)
            rotation = matrix_of(turned_by(turn, alpha * rotation_vector(turn, last_turn)))
            surface.positions = prop.surface[0] @ rotation.T + (1.0 - alpha) * start + alpha * end
        return self._surfaces


def _pose(prop: Prop) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the position and the quaternion of a prop."""
    return np.array(prop.place.position, dtype=np.float64), quaternion_of(
        np.array(prop.place.rotation, dtype=np.float64)
    )


def is_drawn(collider: Collider) -> bool:
    """True for colliders that films show: not sensors, nor horizontal planes, as which the floor is drawn."""
    is_level = isinstance(collider.shape, PlaneShape) and np.asarray(collider.shape.normal)[2] > 1.0 - 1e-9
    return not (is_level or collider.is_sensor)


def drawn_surface(shape: Shape) -> Triangles:
    """Return vertices and triangles of a shape. A height field gets sides down to its lowest point."""
    vertices, triangles = shape.surface()
    if not isinstance(shape, HeightFieldShape):
        return vertices, triangles
    nx, ny, _ = shape.resolution
    row = np.arange(nx * ny).reshape(nx, ny)
    rim = np.concatenate([row[:-1, 0], row[-1, :-1], row[:0:-1, -1], row[0, :0:-1]])
    bottom = vertices[rim] * (1.0, 1.0, 0.0) + (0.0, 0.0, float(vertices[:, 2].min()))
    low, low_next = len(vertices) + np.arange(len(rim)), len(vertices) + np.roll(np.arange(len(rim)), -1)
    top, top_next = rim, np.roll(rim, -1)
    sides = np.concatenate([np.stack([low, low_next, top], 1), np.stack([low_next, top_next, top], 1)])
    return np.concatenate([vertices, bottom]), np.concatenate([triangles, sides]).astype(np.int32)
