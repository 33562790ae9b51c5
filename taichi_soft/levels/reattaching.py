"""Keep the attachments of a body when its level changes: frames hold the nearest vertices of the new mesh.

`level_change` pins the vertices of the new mesh that are nearest to the pinned vertices of the old mesh. Each
new pinned vertex then belongs to the attachment that held the nearest old pinned vertex.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody, context_of
from taichi_soft.control.frames import Frames, exact_position_of
from taichi_soft.core.math.rotations import turned
from taichi_soft.levels.passage import Passage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POSITION, TARGET, REACTION = slice(0, 3), slice(17, 20), slice(23, 26)
"""Columns of `read_motion`: position, target of a pinned vertex, and reaction."""

Reattachments = list[tuple[Any, NDArray[np.int32]]]
"""Attachments of a body, each with the vertices that it constrains after the change of level."""


def reattachments_at(body: SoftBody, over: Passage, held: Ints) -> Reattachments:
    """Return the attachments of a body, each with the vertices that it constrains at another level.

    An attachment can have no vertices at that level.
    Args: held: vertices of the other level that will be pinned.
    """
    attachments = context_of(body).of(Frames).holding(body)
    if not attachments:
        return []
    sources = body.pinned.astype(np.int64)
    nearest = sources[over.nearest_sources(held, sources)]
    return [(each, held[np.isin(nearest, each.particles)].astype(np.int32)) for each in attachments]


def write_targets(reattachments: Reattachments, motion: Floats, rows: Floats, origin: Floats) -> None:
    """Write the targets and the reactions of attached vertices to `rows`.

    A target is a position in the frame of the attachment. The total reaction of an attachment in the last
    step is divided evenly among its new vertices. The division preserves the force exactly and the torque
    approximately.
    Args:
        motion, rows: rows of `read_motion` for the old and the new mesh.
        origin: origin of the body, (3,) [m].
    """
    for attachment, particles in reattachments:
        frame = attachment.frame
        place, axes = exact_position_of(frame) - origin, frame.rotation.astype(float)
        offsets = rows[particles, POSITION] - place
        rows[particles, TARGET] = turned(offsets, axes.T)
        load = motion[attachment.particles, REACTION].sum(axis=0)
        rows[particles, REACTION] = load / len(particles)


def update_handles(reattachments: Reattachments) -> None:
    """Store the new vertices in the attachments."""
    for attachment, particles in reattachments:
        attachment.particles = particles
