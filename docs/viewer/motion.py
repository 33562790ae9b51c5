"""The motion of a stage as data: where all that is seen was in every picture, in some hundred kilobytes.

A motion is a gzip stream of three things: how many bytes its header has, uint32, little-endian; the header,
JSON; and whole numbers from 0 to 65535, the lower bytes of all of them before the upper bytes of all of them.

The numbers are for each part, in the order of the header: the point that each of its `vertices` stands for,
and three vertices for each of its `triangles`. Then come the points of all parts that do not move, and for
each of the `frames` those of all that move: of each part or frame all x, all y and all z. A coordinate is
`lower` and so many times `quantum` [m]. Of what moves, the first frame stands as it is, and each later one as
the change of its change, modulo 65536: that of the frame before is taken to go on.
"""

from __future__ import annotations

import gzip
import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine_adapter import EngineAdapter
from taichi_soft.render import Surface
from taichi_soft.render.colors import to_srgb
from taichi_soft.render.film import Stage
from taichi_soft.render.props import Scenery

LEAST_DT = 1 / 25
"""From one picture to the next, at least [s]: the viewer draws what is between them."""

QUANTUM = 5e-4
"""To which coordinates are rounded, where all of them fit into the numbers [m]: finer is not seen."""

LARGEST = 65535
"""Of the numbers."""


@dataclass
class _Part:
    """A body or a collider: the surface that is drawn, and the different places among its vertices."""

    surface: Surface
    first: NDArray[np.int64]  # the vertex at each of its points
    points: NDArray[np.int64]  # the point of each vertex

    @classmethod
    def of(cls, surface: Surface) -> _Part:
        """Vertices on sharp edges are there once per side, and become one point."""
        _, first, points = np.unique(surface.positions, axis=0, return_index=True, return_inverse=True)
        return cls(surface, first, points.reshape(-1))


def motion_of(stage: Stage, seconds: float | None = None) -> bytes:
    """Play a stage, and keep where its bodies, in the colours of its actors, and its colliders were.

    Args:
        stage: it goes on from where it stands.
        seconds: how long [s]; None: as its film.
    """
    every = max(1, round(LEAST_DT / stage.step.dt))
    count = 1 + round((stage.seconds if seconds is None else seconds) / (every * stage.step.dt))
    scenery = Scenery(stage.world, stage.props, stage.collider_colors)
    bodies = [Surface.of(actor.body.mesh, color=actor.color) for actor in stage.actors]
    game = EngineAdapter(stage.world, stage.step, before_step=stage.act)
    frames: list[list[NDArray[np.float32]]] = []
    parts: list[_Part] = []
    for number in range(count):
        for _ in range(every if number else 0):
            game.step()
        for actor, surface in zip(stage.actors, bodies, strict=True):
            surface.positions = actor.body.positions() + np.asarray(actor.shift, dtype=np.float32)
        shown = [*bodies, *scenery.at(1.0)]
        parts = parts or [_Part.of(surface) for surface in shown]
        frames.append([part.surface.positions[part.first] for part in parts])
    return _packed(stage, parts, frames, 1.0 / (every * stage.step.dt))


def _packed(stage: Stage, parts: list[_Part], frames: list[list[NDArray[np.float32]]], fps: float) -> bytes:
    """All of it, as the head of this file says."""
    rows = [np.stack(each).astype(np.float64) for each in zip(*frames, strict=True)]  # (frames, points, 3)
    lower = np.min([each.min(axis=(0, 1)) for each in rows], axis=0)
    upper = np.max([each.max(axis=(0, 1)) for each in rows], axis=0)
    quantum = max(QUANTUM, float((upper - lower).max()) / LARGEST)
    whole = [np.rint((each - lower) / quantum).astype(np.int64).transpose(0, 2, 1) for each in rows]
    moves = [bool((each != each[0]).any()) for each in whole]
    header = {
        "title": stage.title,
        "fps": fps,
        "frames": len(frames),
        "lower": lower.tolist(),
        "quantum": quantum,
        "floor": stage.world.settings.floor,
        "eye": stage.camera.eye,
        "target": stage.camera.target,
        "fov": stage.camera.fov_degrees,
        "parts": [
            {
                "points": len(part.first),
                "vertices": len(part.points),
                "triangles": len(part.surface.triangles),
                "moves": is_moving,
                "color": to_srgb(part.surface.color[0]).round(3).tolist(),
            }
            for part, is_moving in zip(parts, moves, strict=True)
        ],
    }
    still = [each[0] for each, is_moving in zip(whole, moves, strict=True) if not is_moving]
    moving = [each for each, is_moving in zip(whole, moves, strict=True) if is_moving]
    numbers = [array.ravel() for part in parts for array in (part.points, part.surface.triangles)]
    numbers += [array.ravel() for array in still]
    if moving:
        track = np.concatenate(moving, axis=2).reshape(len(frames), -1)
        change = np.diff(track, axis=0, prepend=0)
        change[2:] = np.diff(change[1:], axis=0)
        numbers.append(change.ravel())
    words = (np.concatenate(numbers) % (LARGEST + 1)).astype("<u2")
    planes = words.view(np.uint8).reshape(-1, 2).T.tobytes()
    text = json.dumps(header).encode()
    return gzip.compress(len(text).to_bytes(4, "little") + text + planes, 9, mtime=0)
