"""Attachments of a body whose level changes: frames hold the nearest vertices of the new mesh.

`level_change` pins the vertices that are nearest to the pinned vertices of the old mesh. Each of them then
belongs to the attachment that held its nearest pinned vertex before.
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

Reattachments = list[tuple[Any, NDArray[np.int32]]]
"""Attachments of a body, each with the vertices that it will hold."""


def reattachments_at(body: SoftBody, over: Passage, held: Ints) -> Reattachments:
    """Find the vertices that each attachment of a body will hold at another level; there can be none.

    Args: held: vertices of that level that will be pinned.
    """
    attachments = context_of(body).of(Frames).holding(body)
    if not attachments:
        return []
    sources = body.pinned.astype(np.int64)
    nearest = sources[over.nearest_sources(held, sources)]
    return [(each, held[np.isin(nearest, each.particles)].astype(np.int32)) for each in attachments]


def write_targets(reattachments: Reattachments, motion: Floats, rows: Floats) -> None:
    """Write each vertex's target in its frame, and its reaction of the last step, to rows of `read_motion`.

    An attachment's load is divided evenly among its vertices. This keeps the force, and the torque
    approximately.
    """
    for attachment, particles in reattachments:
        frame = attachment.frame
        offsets, axes = rows[particles, POSITION] - frame.position, frame.rotation.astype(float)
        rows[particles, TARGET] = turned(offsets, axes.T)
        load = motion[attachment.particles, REACTION].sum(axis=0)
        rows[particles, REACTION] = load / len(particles)


def update_handles(reattachments: Reattachments) -> None:
    """Store the new vertices in the handles."""
    for attachment, particles in reattachments:
        attachment.particles = particles
