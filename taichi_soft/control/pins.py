"""Pin particles, and move pinned particles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody, context_of
from taichi_soft.control.attachments import attached_vertices, require_unattached
from taichi_soft.control.change import (
    attempt,
    change,
    mark_modified,
    named_particles,
    rows_of,
    some_particles,
)
from taichi_soft.control.frames import Frames
from taichi_soft.control.kernels.pins import free_particles, pin_particles, read_pinned, write_targets
from taichi_soft.core.checks import as_array
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError, StateError


def pinned_vertices(body: SoftBody) -> NDArray[np.int32]:
    """Implement `Body.pinned` for a built world."""
    flags = np.empty(body.vertex_count, dtype=np.int32)
    context_of(body).built.read(body.index, read_pinned, flags)
    return np.flatnonzero(flags).astype(np.int32)


def pin(body: SoftBody, particles: ArrayLike) -> None:
    """Implement `Body.pin`."""
    vertices = named_particles(body, particles)
    require_unattached(body, vertices)
    change(body, pin_particles, rows_of(body, vertices))


def unpin(body: SoftBody, particles: ArrayLike | None) -> None:
    """Implement `Body.unpin`."""
    if particles is None:
        vertices = np.setdiff1d(body.pinned, attached_vertices(body))
    else:
        vertices = some_particles(body, particles)
        require_unattached(body, vertices)
    change(body, free_particles, rows_of(body, vertices))


def set_targets(body: SoftBody, particles: ArrayLike, positions: ArrayLike) -> None:
    """Implement `Body.set_targets`."""
    vertices = named_particles(body, particles)
    given = np.asarray(particles)
    if len(vertices) != len(given):
        raise OptionError(f"particles has {len(given) - len(vertices)} vertices twice: give each one once")
    targets = as_array(positions, "positions", (len(given), 3), "m")
    if not np.abs(targets).max() < POSITION_LIMIT:
        raise OptionError(f"positions must be within {POSITION_LIMIT:g} m of the origin")
    require_unattached(body, vertices)
    order = np.argsort(given, kind="stable")
    rows, found = np.ascontiguousarray(targets[order]), np.empty(1, dtype=np.int32)
    attempt(body, write_targets, rows_of(body, vertices), rows, found)
    loose = int(found[0])
    if loose >= 0:
        raise StateError(f"vertex {vertices[loose]} of body {body.index} is not pinned: call body.pin first")
    mark_modified(body)
    context_of(body).of(Frames).has_work = True
