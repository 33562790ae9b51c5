"""Functions that change a body between two steps. All control of bodies uses `change` or `attempt`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import Context, SoftBody, context_of
from taichi_soft.core.checks import as_indices
from taichi_soft.core.conflicts import FLAT
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.types import Schedule

Rows32 = NDArray[np.float32]


def change(body: SoftBody, kernel: Callable[..., Any], *arguments: Any) -> Any:
    """Call `kernel(state, *arguments)`, which changes `body` between two steps, and wake the body.

    Raises: StateError before `World.build`.
    """
    return context_of(body).built.change(body.index, kernel, *arguments)


def attempt(body: SoftBody, kernel: Callable[..., Any], *arguments: Any) -> Any:
    """Call `kernel(state, *arguments)`, which can reject the change. On success, call `mark_modified`."""
    return context_of(body).built.attempt(kernel, *arguments)


def mark_modified(body: SoftBody) -> None:
    """Wake `body` after a successful `attempt`."""
    context_of(body).built.mark_modified(body.index)


def numbers(*values: Any) -> Rows32:
    """Concatenate numbers and vectors into one float32 array, for kernels."""
    return np.concatenate([np.ravel(value) for value in values]).astype(np.float32)


def some_particles(body: SoftBody, particles: ArrayLike | None, name: str = "particles") -> NDArray[np.int32]:
    """Check and sort vertex indices of a body. None means all vertices.

    Raises: OptionError if an index is invalid, or if `particles` is empty.
    """
    if particles is None:
        return np.arange(body.vertex_count, dtype=np.int32)
    return named_particles(body, particles, name)


def named_particles(body: SoftBody, particles: ArrayLike, name: str = "particles") -> NDArray[np.int32]:
    """Check and sort vertex indices of a body.

    Raises: OptionError if an index is invalid, or if `particles` is empty or None.
    """
    vertices = as_indices(particles, name, body.vertex_count)
    if len(vertices) == 0:
        raise OptionError(f"{name} is empty: give at least one vertex, from 0 to {body.vertex_count - 1}")
    return vertices


def mass_of(body: SoftBody, vertices: NDArray[np.int32]) -> float:
    """Return the total mass of `vertices` [kg]. The order of addition is that of the native library."""
    return float(np.cumsum(body.masses[vertices])[-1])


def rows_of(body: SoftBody, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the row in the fields of each of `vertices`. Raises: StateError before `World.build`."""
    return context_of(body).built.rows_of(body.index, vertices)


def require_per_body(context: Context, what: str) -> None:
    """Check that the schedule of a world supports the feature `what`. Raises: StateError."""
    if context.settings.schedule is Schedule.FLAT:
        raise StateError(FLAT.message(feature=what))
