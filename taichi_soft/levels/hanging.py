"""Attachments of a body whose level changes: frames hold the nearest vertices of the new mesh.

A vertex that is held is that which is nearest to one that was held before (see `level_change`). It belongs to
the attachment of the one before that is nearest to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody, context_of
from taichi_soft.control.frames import Frames
from taichi_soft.core.math.rotations import turned
from taichi_soft.levels.passage import Passage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POSITION, TARGET, REACTION = slice(0, 3), slice(17, 20), slice(23, 26)
"""Columns of `read_motion`."""

Hanging = list[tuple[Any, NDArray[np.int32]]]
"""Attachments of a body, and what each will hold."""


def hanging_at(body: SoftBody, over: Passage, held: Ints) -> Hanging:
    """What the attachments of a body will hold at another level; nothing where it has no vertex for one.

    Args: held: vertices that will be held there.
    """
    attachments = context_of(body).of(Frames).holding(body)
    if not attachments:
        return []
    sources = body.pinned.astype(np.int64)
    nearest = sources[over.nearest_sources(held, sources)]
    return [(each, held[np.isin(nearest, each.particles)].astype(np.int32)) for each in attachments]


def hang_on(hanging: Hanging, motion: Floats, rows: Floats) -> None:
    """Write to rows of `read_motion` where the frames hold vertices, and the load of the last step.

    The load is shared evenly by the vertices of an attachment: its force stays, its torque nearly.
    """
    for attachment, particles in hanging:
        frame = attachment.frame
        arms, axes = rows[particles, POSITION] - frame.position, frame.rotation.astype(float)
        rows[particles, TARGET] = turned(arms, axes.T)
        load = motion[attachment.particles, REACTION].sum(axis=0)
        rows[particles, REACTION] = load / len(particles)


def let_hold(hanging: Hanging) -> None:
    """Let the handles know what they hold now."""
    for attachment, particles in hanging:
        attachment.particles = particles
