"""Tear bodies at faces whose stress exceeds a limit."""

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

_WORST_FRACTION = 0.9
"""Smallest stress with which a face tears in a step, as a fraction of the largest stress of all faces. All
other faces are checked again in the next step, when the tear has redistributed the load."""

_TIP_FACTOR = 2.0
"""Factor by which the stress at the end of a tear is multiplied, because the tetrahedra there are too
coarse to resolve the peak of the stress. With this factor, a tear continues before another tear begins."""


class Tears(Slice):
    """Bodies of a world that can tear. They are checked after every step."""

    name = "tears"

    def __init__(self, context: Context) -> None:
        """Start without bodies that tear."""
        super().__init__(context)
        self._limits = np.zeros(0, dtype=np.float32)
        self._found = np.zeros(0, dtype=np.int32)

    @property
    def is_active(self) -> bool:
        """True if any body of the world can tear."""
        return len(self._limits) > 0

    def activate(self, state: BodyFields, program: Program) -> None:
        """Start to check the bodies of a world that is being built, if any asset can tear."""
        slots = self.context.slots
        if any(asset.tearing for asset in slots.kinds):
            self._limits = np.zeros(len(slots.slots), dtype=np.float32)
            self._found = np.zeros(len(slots.slots), dtype=np.int32)
            find_overloaded(state, program, self._limits, self._found)  # compiles the kernel
            for body in slots.occupants:
                self.watch(body)

    def watch(self, body: SoftBody) -> None:
        """If a body can tear, check the body in later steps. It replaces the previous body of its slot."""
        if not self.is_active:
            return
        tearing = body.asset.tearing
        self._limits[body.index] = 0.0 if tearing is None else tearing.stress

    def is_exhausted(self, body: SoftBody) -> bool:
        """True if a body could tear but has no spare vertices left for a tear."""
        return body.asset.tearing is not None and bool(self._limits[body.index] == 0.0)

    def stop(self, body: SoftBody) -> None:
        """Stop checking a body."""
        self._limits[body.index] = 0.0

    def entries(self) -> list[list[Any]]:
        """Return the slot of each body that could tear but has no spare vertices left."""
        return [
            [body.index]
            for body in self.context.slots.occupants
            if self.is_active and self.is_exhausted(body)
        ]

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """Return an empty list: entries contain no serial numbers."""
        return []

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[int]:
        """Return the slots in `entries`. Raises: ValueError for a slot without a body that can tear."""
        slots = [below(slot, len(vertex_counts)) for (slot,) in entries]
        if slots and not (self.is_active and all(vertex_counts[slot] for slot in slots)):
            raise ValueError("slots of tears without a body that can tear")
        return slots

    def restore(self, read: Any) -> None:
        """Check all bodies that can tear, except the bodies in the slots of `read`."""
        for body in self.context.slots.occupants:
            self.watch(body)
            if body.index in read:
                self.stop(body)

    def tear(self) -> Iterator[tuple[SoftBody, tuple[SoftBody, ...]]]:
        """Tear the bodies that the last step overloaded. Yields: each torn body, and its separated pieces."""
        if not self.is_active:
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
            except StateError:  # no spare vertices are left
                self.stop(body)
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
    # Splitting a pinned vertex opens no gap, because its copies are pinned at the same position.
    overloaded = (pull > tearing.stress) & ~np.isin(corners, body.pinned).any(axis=1)
    if not overloaded.any():
        return ()
    pull[is_torn[corners].any(axis=1)] *= _TIP_FACTOR
    chosen = _select_faces(x, mesh.tets, faces, np.where(overloaded, pull, 0.0), axis, tearing.most)
    is_cut = np.zeros(len(pull), dtype=np.bool_)
    is_cut[chosen] = True
    centers = x[mesh.tets].mean(axis=1)
    for face in chosen:
        neighbours = np.flatnonzero(np.isin(corners, corners[face]).any(axis=1))
        side = (centers[faces.tets[neighbours]] - x[corners[face]].mean(axis=0)) @ axis[face] > 0
        is_cut[neighbours[side[:, 0] != side[:, 1]]] = True
    return divide(body, faces, is_cut, keeps_fragments=True)


def _corners(tets: NDArray[np.int32], faces: InnerFaces) -> NDArray[np.int32]:
    """Return the vertices of each face, (f, 3)."""
    return np.asarray(tets[faces.tets[:, :1], faces.corners[:, 0]])


def _select_faces(
    positions: Floats,
    tets: NDArray[np.int32],
    faces: InnerFaces,
    pull: Floats,
    axis: Floats,
    most: int,
) -> list[int]:
    """Return the rows of the faces that tear. They have the largest normal stresses and share no vertex.

    Args:
        pull: (f,) largest principal stress [Pa], zero for faces that must not tear.
        axis: (f, 3) direction of this stress.
        most: largest number of faces.
    """
    overloaded = np.flatnonzero((pull > 0.0) & (pull >= _WORST_FRACTION * pull.max()))
    corners = _corners(tets, faces)
    x = positions[corners[overloaded]]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), 1e-30)  # avoids a division by 0 for a degenerate face
    alignment = np.abs(np.einsum("fa,fa->f", normal, axis[overloaded])) / length
    chosen: list[int] = []
    used: set[int] = set()
    for face in overloaded[np.argsort(-pull[overloaded] * alignment, kind="stable")].tolist():
        if len(chosen) < most and not used & set(corners[face].tolist()):
            chosen.append(face)
            used |= set(corners[face].tolist())
    return chosen
