"""Grabs, which pull bodies to a target."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody, context_of, record_of
from taichi_soft.control.change import change, mass_of, numbers, require_per_body, rows_of
from taichi_soft.control.embedding import embedded
from taichi_soft.control.grab_patch import Patch, patch_around, point_between
from taichi_soft.control.kernels.grabs import (
    ALL_GRABS,
    CORNERS,
    FORCE,
    LIMITS,
    MOST_GRABS,
    PATCH_ROWS,
    PATCHES,
    PLACE,
    RESIDUE,
    USED_GRABS,
    end_grab,
    read_grab,
    write_grab,
    write_grab_target,
)
from taichi_soft.control.numbered import Numbered
from taichi_soft.core.checks import as_array, as_count, as_number, as_vector
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.errors import MeshError, OptionError, StateError
from taichi_soft.core.handles import Handle, handles_of, recorded, serial_of
from taichi_soft.core.residue import rounding_error, weighted_sum
from taichi_soft.core.serialisation import below, vector_of

WEIGHTS = 10.0
"""Default of the largest force of a grab, as a multiple of the body's weight on Earth."""

HIGHEST_SPEED = 50.0
"""Largest speed to which a grab accelerates a body [m/s]. No hand moves faster."""


class Grab(Handle):
    """A grab of a body. Returned by `Body.grab` and `World.grab`."""

    def __init__(self, body: SoftBody, number: int, point: NDArray[np.float64]) -> None:
        """Use `Body.grab` instead."""
        self.body = body
        self._number = number
        self._point = point

    def __repr__(self) -> str:
        return f"Grab(body {self.body.index}, {'held' if self.is_held else 'released'})"

    @property
    def is_held(self) -> bool:
        """True until the grab is released or its body is removed."""
        return self.body.is_alive and context_of(self.body).of(Grabs).by_number.get(self._number) is self

    @property
    def point(self) -> NDArray[np.float64]:
        """Target of the grabbed point, (3,) [m]."""
        return np.array(self._point)

    @property
    def force(self) -> NDArray[np.float32]:
        """Force of the grab on the body in the last substep, (3,) [N]; 0 while the body is frozen.

        Raises: StateError after release.
        """
        self._require_held()
        return _read(self)[1][FORCE]

    @recorded
    def move(self, point: ArrayLike) -> None:
        """Move the target of the grab.

        Args:
            point: new target of the grabbed point, (3,) [m].
        Raises: StateError after release.
        """
        target = as_vector(point, "point", "m")
        self._require_held()
        change(self.body, write_grab_target, self._number, numbers(target, rounding_error(target)))
        self._point = target

    @recorded
    def release(self) -> None:
        """Release the body. Raises: StateError if already released."""
        self._require_held()
        change(self.body, end_grab, self._number, self.body.index)
        del context_of(self.body).of(Grabs).by_number[self._number]

    def _require_held(self) -> None:
        if not self.is_held:
            raise StateError(f"this grab of body {self.body.index} was released: grab again")


class Grabs(Numbered[Grab]):
    """All grabs of one world, by number."""

    name = "grabs"
    prevents_levels = False  # `hold_at` moves the grab to the new level
    most, advice_verb = MOST_GRABS, "release"

    def release_body(self, body: SoftBody) -> None:
        """Release all grabs of a body."""
        for grab in self.holding(body):
            grab.release()

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Compile the kernels: grab a body that has a surface, move the grab and release it."""
        if len(body.surface) == 0:
            return
        with contextlib.suppress(StateError):  # if all grabs are in use, the kernels are compiled already
            grab = grab_at(body, 0, (1 / 3, 1 / 3, 1 / 3), None, 5.0, None)
            grab.move(grab.point)
            _ = grab.force
            if len(body.tets):
                hold_at(grab, place_of(grab))
            grab.release()

    def entries(self) -> list[list[Any]]:
        """List each grab's serial number, index, body and target."""
        return [
            [serial_of(grab), number, grab.body.index, grab.point.tolist()]
            for number, grab in sorted(self.by_number.items())
        ]

    def row_counts(self, entries: list[list[Any]]) -> dict[str, int]:
        """See `Slice.row_counts`. All rows up to the last grab in use are counted."""
        used = max((int(number) for _, number, _, _ in entries), default=-1) + 1
        return {ALL_GRABS: MOST_GRABS, USED_GRABS: used, PATCHES: used * PATCH_ROWS}

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, int, int, NDArray[np.float64]]]:
        """See `Slice.read`. Raises: ValueError for a missing body."""
        found = []
        for serial, number, slot, point in entries:
            if not vertex_counts[below(slot, len(vertex_counts))]:
                raise ValueError("a grab has no body")
            found.append((int(serial), below(number, MOST_GRABS), int(slot), vector_of(point, 3)))
        return found

    def shift_origin(self, offset: NDArray[np.float64]) -> None:
        """See `Slice.shift_origin`."""
        for grab in self.handles:
            grab._point = grab._point - offset

    def restore(self, read: Any) -> None:
        """Replace all grabs by the grabs from `read`."""
        self.by_number.clear()
        for serial, number, slot, point in read:
            body = self.context.slots.slots[slot]
            assert body is not None
            grab = self.context.handles.find(serial, Grab) or Grab(body, number, point)
            self.context.handles.enlist(grab, serial)
            grab.body, grab._number, grab._point = body, number, point
            self.by_number[number] = grab


def as_pull(frequency: Any, max_force: Any) -> tuple[float, float | None]:
    """Check and return the frequency [Hz] and the largest force [N] of a grab. Raises: OptionError.

    A force of None stays None.
    """
    hertz = as_number(frequency, "frequency", 1e-3, 1e3, "a number from 0.001 to 1000 Hz")
    if max_force is None:
        return hertz, None
    return hertz, as_number(max_force, "max_force", 0.0, 1e20, "a number of 0 N or more, or None")


def grab_at(
    body: SoftBody,
    triangle: int,
    barycentrics: ArrayLike,
    point: ArrayLike | None,
    frequency: float,
    max_force: float | None,
) -> Grab:
    """Implement `Body.grab`. `point` is the initial target; None means the position of the grabbed point."""
    if len(body.surface) == 0:
        raise MeshError(f"body {body.index} has no surface to grab")
    number = as_count(triangle, "triangle", 0, len(body.surface) - 1)
    weights = as_array(barycentrics, "barycentrics", (3,))
    if weights.min() < -1e-3 or abs(weights.sum() - 1) > 1e-3:
        raise OptionError(f"barycentrics must be 0 or more and have the sum 1, got {weights.tolist()}")
    weights = np.maximum(weights, 0) / np.maximum(weights, 0).sum()
    hertz, limit = as_pull(frequency, max_force)
    omega, mass = 2 * np.pi * hertz, mass_of(body, np.arange(body.vertex_count, dtype=np.int32))
    strongest = WEIGHTS * GRAVITY_EARTH * mass if limit is None else limit
    require_per_body(context_of(body), "grabs")
    corners = body.surface[number]
    if body.asset.description.is_rigid:
        hull = body.asset.bound_hull
        assert hull is not None
        corners, weights = body.tets[0], (weights[:, None] * hull.weights[corners]).sum(axis=0)
    target = point_between(body.positions()[corners], weights)
    if point is not None:
        target = as_vector(point, "point", "m")
    grabs = context_of(body).of(Grabs).by_number
    free = context_of(body).of(Grabs).free_number()
    patch = patch_around(record_of(body).description, corners, weights)
    spring = (mass * (omega * omega), 2 * mass * omega, 2 * HIGHEST_SPEED / omega)
    limits = (min(strongest, patch.strength), strongest, 1 / mass)
    place, error = np.concatenate([weights, np.zeros(CORNERS - len(weights))]), rounding_error(target)
    row = numbers(place, target, *spring, limits, np.zeros(3), error)
    _write(body, free, np.append(corners, corners[0])[:CORNERS], row, patch)
    grabs[free] = Grab(body, free, target)
    handles_of(body).enlist(grabs[free])
    return grabs[free]


def place_of(grab: Grab) -> NDArray[np.float64]:
    """Return the grabbed point in the rest shape of the body, (3,) [m]."""
    body, (corners, row) = grab.body, _read(grab)
    rows = rows_of(body, np.arange(body.vertex_count, dtype=np.int32))
    order = np.argsort(rows)
    vertices = order[np.searchsorted(rows, corners, sorter=order)]
    weights = row[PLACE].astype(np.float64)
    return weighted_sum(weights / weights.sum(), body.mesh.vertices[vertices])


def hold_at(grab: Grab, place: NDArray[np.float64]) -> None:
    """Move a grab to the body's current tetrahedra, around a point of the rest shape.

    The target, the spring, the largest force and the force in the last substep do not change.
    Args: place: grabbed point in the rest shape, (3,) [m].
    """
    body, (_, row) = grab.body, _read(grab)
    (corners,), (weights,) = embedded(place[None], body.mesh.vertices, body.tets)
    patch = patch_around(record_of(body).description, corners, weights)
    on_patch, strongest = LIMITS.start, LIMITS.start + 1
    row[PLACE], row[on_patch] = weights, min(row[strongest], patch.strength)
    _write(body, grab._number, corners, row, patch)


def _read(grab: Grab) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the corners and numbers of a grab, in the layout of `write_grab`."""
    corners, row = np.empty(CORNERS, dtype=np.int32), np.empty(RESIDUE.stop, dtype=np.float32)
    read_grab(context_of(grab.body).built.state, grab._number, corners, row)
    return corners, row


def _write(
    body: SoftBody, number: int, corners: NDArray[np.int32], row: NDArray[np.float32], patch: Patch
) -> None:
    rows, shares = rows_of(body, patch.vertices), patch.shares.astype(np.float32)
    change(body, write_grab, number, body.index, rows_of(body, corners), row, rows, shares)
