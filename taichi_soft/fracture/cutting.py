"""Cut bodies along the faces of their tetrahedra (thesis chapter 7).

Tetrahedra are connected only by common particles, so a cut duplicates particles and changes no tetrahedron.
A copy starts with the position and velocity of the original particle. The tetrahedra around a particle
determine the particle's mass. Mass, momentum and elastic energy are therefore conserved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.cut_mesh import CutMesh
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.fields import BodyFields, with_spare_rows
from taichi_soft.bodies.kernels.plasticity import read_rest_inverses
from taichi_soft.bodies.layout import BodyArrays, arrange_part, blocks_of
from taichi_soft.bodies.soft_body import (
    Context,
    SoftBody,
    context_of,
    record_of,
    redescribe,
    slices_against_cuts,
)
from taichi_soft.bodies.status import ABSENT, ACTIVE
from taichi_soft.bodies.tet_constants import write_tet_constants
from taichi_soft.contact.fields import touching_edges
from taichi_soft.contact.hull_fields import touching_rows
from taichi_soft.control.attachments import share_attachments
from taichi_soft.control.easing import Easings
from taichi_soft.control.frictions import give_friction
from taichi_soft.core.checks import as_array, as_vector
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.fracture.kernels.topology import (
    MOTION_WIDTH,
    read_motion,
    write_body,
    write_contact_edges,
    write_kind,
    write_touching,
)
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.splitting import InnerFaces, loose_parts, split_vertices

Floats = NDArray[np.float64]

MIN_FRAGMENT = 0.02
"""Smallest volume with which a torn-off piece becomes a new body, as a fraction of the asset's volume.
Smaller pieces remain parts of the torn body."""


def cut(body: SoftBody, plane: Any, triangle: Any) -> tuple[SoftBody, ...]:
    """See `Body.cut`."""
    require_cuttable(body)
    corners, normal, is_plane = _blade(plane, triangle)
    mesh = body.mesh
    faces = record_of(body).description.inner_faces
    centers = body.positions().astype(np.float64)[mesh.tets].mean(axis=1)
    is_cut = _crosses(corners, normal, is_plane, centers[faces.tets[:, 0]], centers[faces.tets[:, 1]])
    return divide(body, faces, is_cut)


def require_cuttable(body: SoftBody) -> None:
    """Check that a body can be cut.

    Raises: OptionError if the body's asset does not allow cuts; StateError if the body cannot be cut now.
    """
    context = context_of(body)
    if body.asset.spare_vertices == 0:
        raise OptionError(
            f"body {body.index} has no room for copies of vertices: make its asset with spare_vertices > 0"
        )
    if context.fields is None:
        raise StateError("the world is not built: call world.build() before the cut")
    reasons = slices_against_cuts(body)
    if reasons:
        raise StateError(
            f"body {body.index} has {' and '.join(reasons)}: release or remove them before it is cut"
        )
    if body.is_frozen:
        raise StateError(f"body {body.index} is frozen: reactivate it with set_motion before it is cut")
    if context.built.state.body_status[body.index] > ABSENT:
        raise StateError(f"body {body.index} is switched off: call set_enabled(True) before it is cut")


def _blade(plane: Any, triangle: Any) -> tuple[Floats, Floats, bool]:
    """Convert the plane or the triangle of a cut to arrays. Raises: OptionError.

    Returns: three corners, (3, 3) [m], which are all the same point for a plane; normal; True for a plane.
    """
    if (plane is None) == (triangle is None):
        raise OptionError("pass plane=(point, normal) or triangle=(3, 3), one of the two")
    if triangle is not None:
        corners = as_array(triangle, "triangle", (3, 3), "m")
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max()
        if not np.linalg.norm(normal) > 1e-9 * longest**2:
            raise OptionError(f"triangle has no area: {corners.tolist()}. Pass three corners not on one line")
        return corners, normal, False
    if not isinstance(plane, (tuple, list, np.ndarray)) or len(plane) != 2:
        raise OptionError(f"plane must be (point, normal), got {plane!r}")
    point, normal = as_vector(plane[0], "point", "m"), as_vector(plane[1], "normal", "(any length)")
    if not np.linalg.norm(normal) > 0.0:
        raise OptionError(f"normal is zero in plane={plane!r}: pass the direction across the plane")
    return np.tile(point, (3, 1)), normal, True


def _crosses(corners: Floats, normal: Floats, is_plane: bool, a: Floats, b: Floats) -> NDArray[np.bool_]:
    """Return True for each segment that crosses the plane or the triangle, (f,).

    Args: a, b: end points of the segments, (f, 3) [m].
    """
    height_a, height_b = (a - corners[0]) @ normal, (b - corners[0]) @ normal
    passes = (height_a > 0) != (height_b > 0)
    if is_plane:
        return np.asarray(passes)
    parameter = height_a / np.where(passes, height_a - height_b, 1.0)
    crossing = a + parameter[:, None] * (b - a)
    for i in range(3):
        start, end = corners[i], corners[(i + 1) % 3]
        passes &= np.cross(end - start, crossing - start) @ normal >= 0
    return np.asarray(passes)


@dataclass(frozen=True)
class _Piece:
    """One connected piece of a cut body."""

    description: BodyDescription
    arrays: BodyArrays
    vertices: NDArray[np.int64]  # (n,) original of each vertex in the body before the cut
    tets: NDArray[np.int64]  # (m,) row of each tetrahedron in the body before the cut


def divide(
    body: SoftBody, faces: InnerFaces, is_cut: NDArray[np.bool_], *, keeps_fragments: bool = False
) -> tuple[SoftBody, ...]:
    """Separate a body along faces. Returns: the pieces that became new bodies, the largest first.

    Args:
        is_cut: (f,), True for each of `faces` that is cut.
        keeps_fragments: True to keep small pieces, and pieces for which no slot is free, in the body.
    Raises: StateError if too few slots are free or a piece does not fit into a slot.
    """
    context, mesh = context_of(body), body.mesh
    assert isinstance(mesh, TetMesh), "other meshes were refused before"
    tets, vertices = split_vertices(mesh.tets, len(mesh.vertices), faces, is_cut)
    if len(vertices) == len(mesh.vertices):
        return ()
    part = loose_parts(tets, len(vertices))
    sizes = np.bincount(part, mesh.volumes)
    numbers = np.argsort(-sizes, kind="stable")  # largest first
    slots = context.slots.free_slots(body.asset)
    if keeps_fragments:
        separated = numbers[1 : 1 + len(slots)]
        volume = body.asset.mesh.volumes.sum()  # type: ignore[attr-defined]
        separated = separated[sizes[separated] >= MIN_FRAGMENT * volume]
        part[~np.isin(part, separated)] = numbers[0]
        numbers = np.r_[numbers[0], separated]
    if len(numbers) > 1 + len(slots):
        raise StateError(
            f"body {body.index} would fall into {len(numbers)} pieces, and {len(slots)} slots are free for "
            f"the {len(numbers) - 1} new ones: reserve more slots of its asset before build, or despawn some"
        )
    pieces = [_piece(body, tets, vertices, np.flatnonzero(part == number)) for number in numbers]
    for piece in pieces:
        require_room(context, body.index, piece.arrays)
    return _write_pieces(context, body, pieces, slots)


def _piece(
    body: SoftBody, tets: NDArray[np.int32], vertices: NDArray[np.int64], rows: NDArray[np.int64]
) -> _Piece:
    """Create the piece that consists of the tetrahedra in `rows`.

    Args: tets, vertices: mesh after the cut, with the original of each vertex.
    """
    before = record_of(body).description
    assert isinstance(before.mesh, TetMesh)
    used, corners = np.unique(tets[rows], return_inverse=True)
    origins = vertices[used]
    description = BodyDescription(
        before.mesh.part(origins, corners.reshape(-1, 4).astype(np.int32), rows),
        before.material.of_tets(rows),  # type: ignore[union-attr]
        before.model,
        np.flatnonzero(np.isin(origins, before.pinned)).astype(np.int32),
    )
    arrays = arrange_part(description, context_of(body).layout.bodies[body.index], origins, rows)
    return _Piece(description, arrays, origins, rows)


def require_room(context: Context, slot: int, arrays: BodyArrays) -> None:
    """Check that a piece of a body fits into its slot. Raises: StateError."""
    place = context.layout.ranges[slot]
    for name, rows, (begin, end) in (
        ("vertices", arrays.mass, place.particles),
        ("edges", arrays.edge_vertices, place.edges),
        ("triangles", arrays.triangles, place.triangles),
    ):
        if len(rows) > end - begin:
            raise StateError(
                f"the cut would leave {len(rows)} {name} in body {slot}, which has room for {end - begin}: "
                f"make its asset with spare_vertices > {context.slots.assets[slot].spare_vertices}"
            )


def _write_pieces(
    context: Context, body: SoftBody, pieces: list[_Piece], slots: list[int]
) -> tuple[SoftBody, ...]:
    """Write the first piece into the body's slot and the other pieces into free slots.

    Returns: handles of the other pieces.
    """
    built = context.built
    state = built.state
    motion = np.empty((body.vertex_count, MOTION_WIDTH), dtype=np.float32)
    read_motion(state, body.index, motion)
    inverses, tet_order = None, context.layout.bodies[body.index].tet_order
    if state.capacity.plastic:
        inverses = np.empty((len(body.tets), 3, 3), dtype=np.float32)
        read_rest_inverses(state, body.index, inverses)
        inverses = inverses[np.argsort(tet_order)]
    for slot, piece in zip([body.index, *slots], pieces, strict=False):
        rows = motion[piece.vertices]
        free = rows[:, 12] > 0.0
        masses = piece.description.masses
        rows[free, 12] = 1.0 / masses[free]
        rows[:, 20:26] *= (masses / rows[:, 15])[:, None]  # external forces and reactions are scaled by mass
        rows[:, 15] = masses
        present = None if inverses is None else inverses[piece.tets][piece.arrays.tet_order]
        write_slot(context, state, slot, piece.arrays, rows, ACTIVE, body.index, present)
    built.mark_changed()
    detached = tuple(context.make_handle(context, body.asset) for _ in pieces[1:])
    vertices, tets = body.vertex_origins, body.tet_origins
    for each, piece in zip((body, *detached), pieces, strict=True):
        redescribe(each, piece.description, piece.arrays)
        corners, order = piece.description.mesh.tets, piece.arrays.order
        record_of(each).set_topology(CutMesh(vertices[piece.vertices], order, tets[piece.tets], corners))
    if record_of(body).friction is not None:
        for each in detached:
            give_friction(state, each, body.friction)
    share_attachments(
        body, [(each, piece.vertices) for each, piece in zip((body, *detached), pieces, strict=True)]
    )
    context.of(Easings).share(
        body, tet_order, [(each, piece.tets) for each, piece in zip((body, *detached), pieces, strict=True)]
    )
    built.on_cut(body)
    return detached


def warm_up(context: Context, state: BodyFields, slot: int) -> None:
    """Rewrite a body's slot unchanged, so that the kernels are compiled before the first cut in a game."""
    read_motion(
        state, slot, np.empty((len(context.layout.bodies[slot].mass), MOTION_WIDTH), dtype=np.float32)
    )
    refill_slot(context, state, slot)


def refill_slot(
    context: Context, state: BodyFields, slot: int, level: int = 0, part: BodyArrays | None = None
) -> None:
    """Write the asset of a slot, at rest, into the slot. Call this if the slot had a different body before.

    Args:
        level: level of detail of the asset.
        part: arrays to write in place of those of the whole asset.
    """
    asset = context.slots.assets[slot].levels[level]
    arrays = asset.arrays if part is None else part
    rows = np.zeros((len(arrays.mass), MOTION_WIDTH), dtype=np.float32)
    write_slot(context, state, slot, arrays, rows, ABSENT, slot, None)
    _write_kind(state, slot, asset)  # the fields can contain another material, from the slot's previous body
    context.layout.bodies[slot] = arrays


def write_surface(context: Context, state: BodyFields, slot: int, asset: SoftBodyAsset) -> None:
    """Write the constants of an asset into a slot, if the slot can contain other constants.

    A slot can contain other constants if the asset has several levels of detail or can be cut.
    """
    if context.slots.assets[slot].coarser or asset.spare_vertices:
        _write_kind(state, slot, asset)


def _write_kind(state: BodyFields, slot: int, asset: SoftBodyAsset) -> None:
    write_kind(state, slot, kind_numbers(state, asset))


def kind_numbers(state: BodyFields, asset: SoftBodyAsset) -> NDArray[np.float32]:
    """Return the row of an asset for `write_kind`, (7,)."""
    row = [*asset.surface_row[:2], *asset.kind_row(is_implicit=state.capacity.implicit)]
    return np.array(row, dtype=np.float32)


def write_slot(
    context: Context,
    state: BodyFields,
    slot: int,
    arrays: BodyArrays,
    motion: NDArray[np.float32],
    status: int,
    model_of: int,
    inverses: NDArray[np.float32] | None,
) -> None:
    """Write a body with its motion into a slot.

    Args:
        motion: rows of the body's vertices, see `read_motion`.
        status: status of the body, such as `ACTIVE`.
        model_of: see `write_body`.
        inverses: current inverse rest shapes of a body with plasticity, (m, 3, 3); otherwise None.
    """
    write_body(state, slot, status, model_of, motion, *body_rows(arrays, inverses))
    write_tet_constants(state, context.layout.ranges[slot].blocks[0], arrays)
    if state.capacity.contact.hull:  # type: ignore[attr-defined]
        write_touching(state, slot, *touching_rows(arrays, context.layout.ranges[slot]))
    if state.capacity.contact.soft:  # type: ignore[attr-defined]
        edges, sharp = touching_edges(arrays, context.layout.ranges[slot])
        write_contact_edges(state, slot, sharp, edges)


def body_rows(arrays: BodyArrays, inverses: NDArray[np.float32] | None = None) -> tuple[NDArray[Any], ...]:
    """Return the arguments of `write_body` that follow `motion`. For the parameters, see `write_slot`."""
    first = _float_blocks(np.swapaxes(arrays.rest_inverse, 1, 2), 9)
    present = first if inverses is None else _float_blocks(np.swapaxes(inverses, 1, 2), 9)
    return (
        arrays.rest_position.astype(np.float32),
        arrays.rank,
        blocks_of(arrays.tet_vertices, 4, 0),
        blocks_of(arrays.tet_edges, 6, 0),
        np.stack([present, first]),
        with_spare_rows(arrays.edge_vertices),
        with_spare_rows(arrays.edge_damping).astype(np.float32),
        arrays.edge_blocks,
        arrays.triangles,
        arrays.outer,
    )


def _float_blocks(rows: NDArray[Any], width: int) -> NDArray[np.float32]:
    return blocks_of(rows.reshape(len(rows), width), width, 0).astype(np.float32)
