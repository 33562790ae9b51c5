"""Bodies that tear where they are pulled too hard."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.measures import positions_of, tet_stresses
from taichi_soft.bodies.soft_body import Context, Slice, SoftBody, record_of, slices_against_cuts
from taichi_soft.core.errors import StateError
from taichi_soft.core.serialisation import below
from taichi_soft.fracture.cutting import divide
from taichi_soft.fracture.kernels.tearing import find_overloaded
from taichi_soft.meshing.splitting import InnerFaces

Floats = NDArray[np.float64]

_WORST = 0.9
"""Of the largest stress: what bears less waits for the next step, in which the tear has shifted the load."""

_TIP = 2.0
"""Stress at the end of a tear over that of the tetrahedra there, which are too large to resolve its rise: so
that a tear runs on before another begins."""


class Tears(Slice):
    """Where a world's bodies may tear, after every step."""

    name = "tears"

    def __init__(self, context: Context) -> None:
        """Nobody tears."""
        super().__init__(context)
        self._limits = np.zeros(0, dtype=np.float32)
        self._found = np.zeros(0, dtype=np.int32)

    @property
    def is_open(self) -> bool:
        """Whether any body of the world can tear."""
        return len(self._limits) > 0

    def open(self, state: BodyFields, program: Program) -> None:
        """Look from now on, in a world that is being built, if anything in it can tear."""
        slots = self.context.slots
        if any(asset.tearing for asset in slots.kinds):
            self._limits = np.zeros(len(slots.slots), dtype=np.float32)
            self._found = np.zeros(len(slots.slots), dtype=np.int32)
            find_overloaded(state, program, self._limits, self._found)  # compiles
            for body in slots.occupants:
                self.watch(body)

    def watch(self, body: SoftBody) -> None:
        """Look at a body from now on, if it can tear; its slot may have held another."""
        if not self.is_open:
            return
        tearing = body.asset.tearing
        self._limits[body.index] = 0.0 if tearing is None else tearing.stress

    def rests(self, body: SoftBody) -> bool:
        """Whether a body that can tear has no room for it any more."""
        return body.asset.tearing is not None and bool(self._limits[body.index] == 0.0)

    def rest(self, body: SoftBody) -> None:
        """Look at a body no more."""
        self._limits[body.index] = 0.0

    def entries(self) -> list[list[Any]]:
        """Slots of the bodies that tear no more."""
        return [[body.index] for body in self.context.slots.occupants if self.is_open and self.rests(body)]

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """None."""
        return []

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[int]:
        """Rows of `entries`. Raises: ValueError for a slot that holds nobody."""
        slots = [below(slot, len(vertex_counts)) for (slot,) in entries]
        if slots and not (self.is_open and all(vertex_counts[slot] for slot in slots)):
            raise ValueError("nobody tears there")
        return slots

    def restore(self, read: Any) -> None:
        """Look at all bodies but those that were `read`."""
        for body in self.context.slots.occupants:
            self.watch(body)
            if body.index in read:
                self.rest(body)

    def tear(self) -> Iterator[tuple[SoftBody, tuple[SoftBody, ...]]]:
        """Tear what the last step has pulled too hard. Yields: each body that tore, and what fell off it."""
        if not self.is_open:
            return
        built = self.context.built
        find_overloaded(built.state, built.program, self._limits, self._found)
        for slot in np.flatnonzero(self._found).tolist():
            body = self.context.slots.slots[slot]
            if body is None or slices_against_cuts(body):
                continue
            version = body.topology_version
            try:
                pieces = _tear(body)
            except StateError:  # no room for more copies
                self.rest(body)
                continue
            if body.topology_version != version:
                yield body, pieces


def _tear(body: SoftBody) -> tuple[SoftBody, ...]:
    tearing, mesh = body.asset.tearing, body.mesh
    assert tearing is not None
    stress, x = tet_stresses(body), positions_of(body)
    faces = record_of(body).description.inner_faces
    pulls, axes = np.linalg.eigh(stress[faces.tets].mean(axis=1))
    pull, axis = pulls[:, -1], axes[:, :, -1]
    is_torn = np.bincount(body.vertex_origins)[body.vertex_origins] > 1
    corners = _corners(mesh.tets, faces)
    # A vertex that is held opens nothing when it is split: copies of it are held where it is.
    over = (pull > tearing.stress) & ~np.isin(corners, body.pinned).any(axis=1)
    if not over.any():
        return ()
    pull[is_torn[corners].any(axis=1)] *= _TIP
    chosen = _worst_faces(x, mesh.tets, faces, np.where(over, pull, 0.0), axis, tearing.most)
    is_cut = np.zeros(len(pull), dtype=np.bool_)
    is_cut[chosen] = True
    centers = x[mesh.tets].mean(axis=1)
    for face in chosen:
        near = np.flatnonzero(np.isin(corners, corners[face]).any(axis=1))
        side = (centers[faces.tets[near]] - x[corners[face]].mean(axis=0)) @ axis[face] > 0
        is_cut[near[side[:, 0] != side[:, 1]]] = True
    return divide(body, faces, is_cut, keeps_crumbs=True)


def _corners(tets: NDArray[np.int32], faces: InnerFaces) -> NDArray[np.int32]:
    """Vertices of each face, (f, 3)."""
    return np.asarray(tets[faces.tets[:, :1], faces.corners[:, 0]])


def _worst_faces(
    positions: Floats,
    tets: NDArray[np.int32],
    faces: InnerFaces,
    pull: Floats,
    axis: Floats,
    most: int,
) -> list[int]:
    """Those that tear: the worst, most across the pull, without a common vertex.

    `pull`: (f,) [Pa], zero for faces that hold.
    """
    over = np.flatnonzero((pull > 0.0) & (pull >= _WORST * pull.max()))
    corners = _corners(tets, faces)
    x = positions[corners[over]]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), 1e-30)  # drawn to a line, a face has no normal
    across = np.abs(np.einsum("fa,fa->f", normal, axis[over])) / length
    chosen: list[int] = []
    used: set[int] = set()
    for face in over[np.argsort(-pull[over] * across, kind="stable")].tolist():
        if len(chosen) < most and not used & set(corners[face].tolist()):
            chosen.append(face)
            used |= set(corners[face].tolist())
    return chosen
