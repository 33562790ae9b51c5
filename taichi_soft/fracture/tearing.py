"""Bodies that tear where they are pulled too hard."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.measures import green_strain_and_stress
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.errors import StateError
from taichi_soft.fracture.cutting import divide
from taichi_soft.fracture.kernels.tearing import find_overloaded
from taichi_soft.meshing.splitting import InnerFaces

Floats = NDArray[np.float64]

_WORST = 0.9
"""Of the largest stress: what bears less waits for the next step, in which the tear has shifted the load."""

_TIP = 2.0
"""Stress at the end of a tear over that of the tetrahedra there, which are too large to resolve its rise: so
that a tear runs on before another begins."""


class Tears:
    """Where a world's bodies may tear, after every step."""

    def __init__(self, state: BodyFields, slots: Sequence[SoftBody | None]) -> None:
        """Args: slots: the body in each."""
        self._state, self._slots = state, slots
        self._limits = np.zeros(len(slots), dtype=np.float32)
        self._found = np.zeros(len(slots), dtype=np.int32)
        find_overloaded(state, self._limits, self._found)  # compiles

    def watch(self, body: SoftBody) -> None:
        """Look at a body from now on, if it can tear; its slot may have held another."""
        tearing = body.asset.tearing
        self._limits[body.index] = 0.0 if tearing is None else tearing.stress

    def rests(self, body: SoftBody) -> bool:
        """Whether a body that can tear has no room for it any more."""
        return body.asset.tearing is not None and bool(self._limits[body.index] == 0.0)

    def rest(self, body: SoftBody) -> None:
        """Look at a body no more."""
        self._limits[body.index] = 0.0

    def tear(self) -> Iterator[tuple[SoftBody, tuple[SoftBody, ...]]]:
        """Tear what the last step has pulled too hard. Yields: each body that tore, and what fell off it."""
        find_overloaded(self._state, self._limits, self._found)
        for slot in np.flatnonzero(self._found).tolist():
            body = self._slots[slot]
            if body is None or body._is_pulled:
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
    stress = green_strain_and_stress(body)[1]
    faces = body._description.inner_faces
    pulls, axes = np.linalg.eigh(stress[faces.tets].mean(axis=1))
    pull, axis = pulls[:, -1], axes[:, :, -1]
    is_torn = np.bincount(body.vertex_origins)[body.vertex_origins] > 1
    corners = _corners(mesh.tets, faces)
    # A vertex that is held opens nothing when it is split: copies of it are held where it is.
    over = (pull > tearing.stress) & ~np.isin(corners, body.pinned).any(axis=1)
    if not over.any():
        return ()
    pull[is_torn[corners].any(axis=1)] *= _TIP
    chosen = _worst_faces(mesh.vertices, mesh.tets, faces, np.where(over, pull, 0.0), axis, tearing.most)
    is_cut = np.zeros(len(pull), dtype=np.bool_)
    is_cut[chosen] = True
    centers = mesh.vertices[mesh.tets].mean(axis=1)
    for face in chosen:
        near = np.flatnonzero(np.isin(corners, corners[face]).any(axis=1))
        side = (centers[faces.tets[near]] - mesh.vertices[corners[face]].mean(axis=0)) @ axis[face] > 0
        is_cut[near[side[:, 0] != side[:, 1]]] = True
    return divide(body, faces, is_cut, keeps_crumbs=True)


def _corners(tets: NDArray[np.int32], faces: InnerFaces) -> NDArray[np.int32]:
    """Vertices of each face, (f, 3)."""
    return np.asarray(tets[faces.tets[:, :1], faces.corners[:, 0]])


def _worst_faces(
    vertices: Floats,
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
    x = vertices[corners[over]]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    across = np.abs(np.einsum("fa,fa->f", normal, axis[over])) / np.linalg.norm(normal, axis=1)
    chosen: list[int] = []
    used: set[int] = set()
    for face in over[np.argsort(-pull[over] * across, kind="stable")].tolist():
        if len(chosen) < most and not used & set(corners[face].tolist()):
            chosen.append(face)
            used |= set(corners[face].tolist())
    return chosen
