"""Bodies of a world as flat NumPy arrays with offsets: the contents of the Taichi fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.contact_edges import find_contact_edges, has_slim_edges
from taichi_soft.bodies.description import BodyDescription, outer_vertices, rest_inverses
from taichi_soft.core.constants import HALF, LANES
from taichi_soft.elements.laws import BondLaw, ElementModel
from taichi_soft.elements.laws.bonds import Bonds, Ring
from taichi_soft.elements.laws.rod import Rods
from taichi_soft.elements.laws.shell import Shells
from taichi_soft.meshing import (
    BodyMesh,
    TetMesh,
    edge_owners,
    renumbered,
    spatial_order,
    tet_order,
)

CUT_EDGES = 6
"""Number of rows for contact edges per vertex that a cut copies. Cuts follow faces of tetrahedra, so that all
edges of the new surfaces can be sharp. Edges without a row have no contact."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class BondArrays:
    """The bonds of one body, in kernel order."""

    constants: Floats  # (k, 4), see `Bonds`
    ring: Ints  # (k, 2) range of rows of each edge in `members` and `weights`
    members: Ints  # (r, 4) particles or tetrahedra of this body
    weights: Floats  # (r, 4)
    expansion_modulus: Floats | None  # (m,) [Pa], if the members are tetrahedra


@dataclass(frozen=True)
class ShellArrays:
    """The triangles of a shell, in kernel order. See `Shells`."""

    order: Ints  # (m,) caller's index of each triangle
    points: Ints  # (m, 6) particles of this body
    rest_inverse: Floats  # (m, 3) [1/m]
    lame: Floats  # (m, 2) [J]
    bending: Floats  # (m, 18)
    bending_damping: Floats  # (m, 1) [s]


@dataclass(frozen=True)
class HullArrays:
    """Hull that makes contact instead of a body's surface: see `bodies.bound_hull`."""

    vertices: Ints  # (h, 4) particles of this body that carry each point
    weights: Floats  # (h, 4)
    triangles: Ints  # (t, 3) points of each triangle


@dataclass(frozen=True)
class BodyArrays:
    """One body in kernel order."""

    order: Ints  # (n,) caller's index of each particle
    rank: Ints  # (n,) particle of each vertex, in the caller's order
    rest_position: Floats  # (n, 3) [m]
    mass: Floats  # (n,) [kg]
    tet_vertices: Ints  # (m, 4) particles of this body
    tet_order: Ints  # (m,) caller's index of each tetrahedron
    rest_inverse: Floats  # (m, 3, 3) [1/m]
    lame: Floats  # (m, 2) lambda, mu [Pa]; zero if the stiffness is anisotropic
    stiffness: Floats  # (m, 21) [Pa], upper triangle of an anisotropic stiffness; else zero
    tet_damping: Floats  # (m,) [N s/m]
    tet_edges: Ints  # (m, 6) edges of each tetrahedron, in the order of `LOCAL_EDGES`
    edge_vertices: Ints  # (k, 2) particles at the ends of each edge
    edge_order: Ints  # (k,) caller's index of each edge
    edge_blocks: Ints  # (c, 2) first row and number of edges of each block: see `_edge_blocks`
    edge_damping: Floats  # (k,) [N s/m]
    bonds: BondArrays | None  # None unless the law is pairwise
    shells: ShellArrays | None  # None unless the body is a shell
    rods: Rods | None  # None unless the body is a rod
    pinned: Ints  # particles that do not move
    triangles: Ints  # (f, 3) particles of the surface triangles, in the caller's order
    outer: Ints  # particles of the surface, which can make contact; all particles of ropes and cloth
    contact_edges: Ints  # (c, 4) see `find_contact_edges`; between points of the hull, if there is a hull
    sharp_edges: int  # number of sharp contact edges, which come first
    is_slim: bool  # True if a contact edge is slim, see `has_slim_edges`
    hull: HullArrays | None = None  # hull; if there is one, it makes contact instead of `outer`
    radii: Floats | None = None  # (3,) [m], see `RigidMesh`; None if the body can deform
    has_faces: bool = True  # see `Contact.faces`

    @property
    def expansion_modulus(self) -> Floats:
        """Pressure of each tetrahedron on its edges, divided by its relative change of volume, (m,) [Pa].

        The pressure is zero if the law has no expansion.
        """
        if self.bonds is None or self.bonds.expansion_modulus is None:
            return np.zeros(len(self.tet_vertices))
        return self.bonds.expansion_modulus


@dataclass
class Ranges:
    """Ranges of rows of a body in the world's flat arrays, including spare rows for cuts."""

    particles: tuple[int, int] = (0, 0)
    edges: tuple[int, int] = (0, 0)
    edge_blocks: tuple[int, int] = (0, 0)
    blocks: tuple[int, int] = (0, 0)
    rings: tuple[int, int] = (0, 0)
    shells: tuple[int, int] = (0, 0)  # blocks of shell elements
    triangles: tuple[int, int] = (0, 0)
    outer: tuple[int, int] = (0, 0)
    contact_edges: tuple[int, int] = (0, 0)  # see `Scene.assign_contact_edges`
    has_flat_edges: bool = False  # True if the rows also contain the edges that are not sharp


@dataclass
class Scene:
    """All bodies of a world in sequence.

    `LANES` spare rows follow the edges of each body. Kernels read the last block of edges in full, and this
    block must not contain edges of another body, which another thread may move at the same time.
    """

    bodies: list[BodyArrays] = field(default_factory=list)
    ranges: list[Ranges] = field(default_factory=list)
    particle_count: int = 0
    edge_count: int = 0  # including the spare rows
    edge_block_count: int = 0
    block_count: int = 0
    ring_count: int = 0
    shell_count: int = 0  # blocks of shell elements
    triangle_count: int = 0
    outer_count: int = 0
    contact_edge_count: int = 0  # see `assign_contact_edges`

    @property
    def has_bonds(self) -> bool:
        """True if any body has a pairwise law."""
        return any(body.bonds is not None for body in self.bodies)

    @property
    def ends(self) -> Ranges:
        """Empty ranges at the rows where the next body would start."""
        return Ranges(
            (self.particle_count,) * 2,
            (self.edge_count,) * 2,
            (self.edge_block_count,) * 2,
            (self.block_count,) * 2,
            (self.ring_count,) * 2,
            (self.shell_count,) * 2,
            (self.triangle_count,) * 2,
            (self.outer_count,) * 2,
        )

    def append(self, body: BodyArrays, spare_vertices: int = 0) -> None:
        """Assign the next free rows to `body`, with spare rows for `spare_vertices` copies of vertices."""
        blocks = -(-len(body.tet_vertices) // LANES)
        rings = 0 if body.bonds is None else len(body.bonds.members)
        shells = 0 if body.shells is None else -(-len(body.shells.points) // LANES)
        particles, edges, edge_blocks, triangles, outer = room_of(body, spare_vertices)
        self.ranges.append(
            Ranges(
                (self.particle_count, self.particle_count + particles),
                (self.edge_count, self.edge_count + edges),
                (self.edge_block_count, self.edge_block_count + edge_blocks),
                (self.block_count, self.block_count + blocks),
                (self.ring_count, self.ring_count + rings),
                (self.shell_count, self.shell_count + shells),
                (self.triangle_count, self.triangle_count + triangles),
                (self.outer_count, self.outer_count + outer),
            )
        )
        self.bodies.append(body)
        self.particle_count += particles
        self.edge_count += edges + LANES
        self.edge_block_count += edge_blocks
        self.block_count += blocks
        self.ring_count += rings
        self.shell_count += shells
        self.triangle_count += triangles
        self.outer_count += outer

    def assign_contact_edges(
        self, levels: Sequence[Sequence[BodyArrays]], spare_vertices: Sequence[int]
    ) -> None:
        """Assign rows to the contact edges of all bodies: all edges if a rope or a slim body can touch them,
        else the sharp ones.

        Args:
            levels: levels of detail of each body.
            spare_vertices: number of copies of vertices that cuts can add to each body.
        """
        has_flat = any(each.is_slim or not len(each.triangles) for level in levels for each in level)
        self.contact_edge_count = 0
        for place, arrays, spare in zip(self.ranges, levels, spare_vertices, strict=True):
            count = max(len(each.contact_edges) if has_flat else each.sharp_edges for each in arrays)
            end = self.contact_edge_count + count + CUT_EDGES * spare
            place.contact_edges, place.has_flat_edges = (self.contact_edge_count, end), has_flat
            self.contact_edge_count = end


def room_of(body: BodyArrays, spare_vertices: int) -> tuple[int, int, int, int, int]:
    """Count the rows that a body and the copies of its vertices need.

    Returns: numbers of particles, edges, blocks of edges, triangles and outer particles.

    The points of a hull follow the particles of the body. Triangles and points of a hull have separate rows,
    numbered like the rows of the surface.

    A cut has about three edges per vertex, and two triangles per vertex on each side. A small cut that ends
    inside the body can have twice as many edges and triangles (Euler's formula).
    """
    if spare_vertices == 0:
        exact = body.mass, body.edge_vertices, body.edge_blocks, body.triangles, body.outer
        particles, edges, blocks, triangles, outer = (len(rows) for rows in exact)
        if body.hull is not None:
            points = len(body.hull.vertices)
            particles += points
            triangles, outer = max(triangles, len(body.hull.triangles)), max(outer, points)
        return particles, edges, blocks, triangles, outer
    particles = len(body.mass) + spare_vertices
    edges = len(body.edge_vertices) + 6 * spare_vertices
    # All blocks are full, except those that contain the last edges of a particle.
    blocks = (edges + (LANES - 1) * particles) // LANES
    return particles, edges, blocks, len(body.triangles) + 12 * spare_vertices, particles


def arrange(description: BodyDescription) -> BodyArrays:
    """Return the arrays of a body, with particles in the order of a space-filling curve.

    In this order, neighbours share cache lines. The particles of a rod are in the order of the rod.
    """
    mesh = description.mesh
    is_rod = description.rods is not None
    order = np.arange(len(mesh.vertices), dtype=np.int32) if is_rod else spatial_order(mesh.vertices)
    tets = tet_order(mesh.tets, order) if len(mesh.tets) else np.zeros(0, dtype=np.int32)
    edges = renumbered(order)[mesh.edges]
    if description.model.has_simple_edges:  # these edges have no direction; other edges point from i to j
        edges = _directed_edges(np.sort(edges, axis=1), len(order))
    return _in_order(description, order, tets, edges)


def arrange_part(
    description: BodyDescription,
    before: BodyArrays,
    vertices: NDArray[np.int64],
    tets: NDArray[np.int64],
    order: Ints | None = None,
) -> BodyArrays:
    """Return the arrays of the rest of a cut body, in the order before the cut.

    Copies of vertices follow their originals.

    Args:
        description: description of the body after the cut.
        before: arrays of the body before the cut.
        vertices, tets: original of each vertex and each tetrahedron in the body before the cut.
        order: order of the vertices. None: copies of the same vertex are ordered by their indices.
    """
    mesh, rank = description.mesh, before.rank[vertices]
    if order is None:
        order = np.argsort(rank, kind="stable").astype(np.int32)
    ends = rank[mesh.edges].astype(np.int64)
    # The first end of an edge stays the first end after the cut.
    count = len(before.rank)
    old_keys = np.sort(before.edge_vertices, axis=1).astype(np.int64) @ [count, 1]
    by_key = np.argsort(old_keys)
    old_row = by_key[np.searchsorted(old_keys[by_key], np.sort(ends, axis=1) @ [count, 1])]
    keeps_direction = ends[:, 0] == before.edge_vertices[old_row, 0]
    edges = renumbered(order)[np.where(keeps_direction[:, None], mesh.edges, mesh.edges[:, ::-1])]
    tet_order = np.argsort(renumbered(before.tet_order)[tets]).astype(np.int32)
    return _in_order(description, order, tet_order, edges)


def _in_order(description: BodyDescription, order: Ints, tets: Ints, edges: Ints) -> BodyArrays:
    """Return the arrays of a body for an order of particles, an order of tetrahedra and directed edges."""
    mesh, new_index = description.mesh, renumbered(order)
    edge_order = np.lexsort((edges[:, 1], edges[:, 0])).astype(np.int32)
    positions, triangles = mesh.vertices[order], new_index[mesh.surface]
    contact_edges, sharp_edges = find_contact_edges(positions, triangles, edges)
    return BodyArrays(
        order=order,
        rank=new_index,
        rest_position=positions,
        mass=description.masses[order],
        tet_vertices=new_index[mesh.tets[tets]],
        tet_order=tets,
        rest_inverse=rest_inverses(mesh)[tets],
        lame=description.lame[tets],
        stiffness=description.stiffness[tets],
        tet_damping=description.per_tet("damping")[tets],
        tet_edges=_arrange_tet_edges(mesh, tets, edge_order),
        edge_vertices=edges[edge_order],
        edge_order=edge_order,
        edge_blocks=_edge_blocks(edges[edge_order, 0]),
        edge_damping=description.edge_damping[edge_order],
        bonds=_arrange_bonds(description.bonds, description.model, edge_order, new_index, renumbered(tets)),
        shells=_arrange_shells(description.shells, new_index),
        rods=description.rods,
        pinned=new_index[description.pinned],
        triangles=triangles,
        outer=np.sort(new_index[outer_vertices(mesh)]),
        contact_edges=contact_edges,
        sharp_edges=sharp_edges,
        is_slim=has_slim_edges(positions, contact_edges, sharp_edges),
    )


def rearrange(arrays: BodyArrays, description: BodyDescription) -> BodyArrays:
    """Return the arrays of the same body with the material of `description`, in the same order."""
    tets, bonds = arrays.tet_order, description.bonds
    return replace(
        arrays,
        mass=description.masses[arrays.order],
        lame=description.lame[tets],
        stiffness=description.stiffness[tets] if arrays.stiffness.any() else arrays.stiffness,
        tet_damping=description.per_tet("damping")[tets],
        edge_damping=description.edge_damping[arrays.edge_order],
        bonds=_arrange_bonds(bonds, description.model, arrays.edge_order, arrays.rank, renumbered(tets)),
        shells=_arrange_shells(description.shells, arrays.rank),
        rods=description.rods,
    )


def _directed_edges(edges: Ints, particle_count: int) -> Ints:
    """Orient the edges so that the number of edges that start at a particle is a multiple of `HALF`.

    This is possible for most particles.
    """
    in_order = edges[np.lexsort((edges[:, 1], edges[:, 0]))]
    keys = in_order[:, 0].astype(np.int64) * particle_count + in_order[:, 1]
    owner = edge_owners(in_order, particle_count, HALF)
    first_end = owner[np.searchsorted(keys, edges[:, 0].astype(np.int64) * particle_count + edges[:, 1])]
    return np.asarray(np.where(edges[:, :1] == first_end[:, None], edges, edges[:, ::-1]))


def _edge_blocks(first_ends: Ints) -> Ints:
    """Divide the edges into blocks of at most `LANES`. Return first row and length of each block, (c, 2).

    A block has two halves. All edges of a half have the same first end. Rows are ordered by first end. A half
    that is not full ends its block, so that the rows of a block are contiguous.
    """
    starts = np.flatnonzero(np.r_[True, first_ends[1:] != first_ends[:-1]])
    counts = np.diff(np.r_[starts, len(first_ends)])
    halves = -(-counts // HALF)
    # Index of each half among the halves with the same first end.
    number = np.arange(halves.sum()) - np.repeat(np.cumsum(halves) - halves, halves)
    rows = np.repeat(starts, halves) + number * HALF
    sizes = np.minimum(np.repeat(counts, halves) - number * HALF, HALF)
    ends_block = np.r_[True, sizes[:-1] < HALF][: len(sizes)]
    since = np.arange(len(sizes)) - np.maximum.accumulate(np.where(ends_block, np.arange(len(sizes)), 0))
    leads = since % 2 == 0
    follows = np.r_[~leads[1:], False][: len(sizes)]  # True if the next half belongs to the same block
    both = sizes + np.where(follows, np.r_[sizes[1:], 0][: len(sizes)], 0)
    return np.stack([rows[leads], both[leads]], axis=1).astype(np.int32)


def _arrange_tet_edges(mesh: BodyMesh, tets: Ints, edge_order: Ints) -> Ints:
    if not isinstance(mesh, TetMesh):
        return np.zeros((0, 6), dtype=np.int32)
    new_edge = np.empty(len(edge_order), dtype=np.int32)
    new_edge[edge_order] = np.arange(len(edge_order))
    return np.asarray(new_edge[mesh.tet_edges[tets]])


def _arrange_bonds(
    bonds: Bonds | None, model: ElementModel, edge_order: Ints, new_vertex: Ints, new_tet: Ints
) -> BondArrays | None:
    if bonds is None:
        return None
    members_are_tets = isinstance(model.law, BondLaw) and model.law.ring is Ring.EXPANSION
    count = np.bincount(bonds.ring_edge, minlength=len(edge_order))
    start = np.cumsum(count) - count
    ends = np.cumsum(count[edge_order])
    ring = np.stack([ends - count[edge_order], ends], axis=1)
    # The rows of an edge keep their order.
    rows = np.repeat(start[edge_order] - ring[:, 0], count[edge_order]) + np.arange(len(bonds.ring_edge))
    members = bonds.ring_members[rows]
    renumbered_members = (
        (new_tet if members_are_tets else new_vertex)[np.maximum(members, 0)] if len(members) else members
    )
    modulus = bonds.expansion_modulus
    return BondArrays(
        bonds.constants[edge_order],
        ring.astype(np.int32),
        np.where(members >= 0, renumbered_members, 0).astype(np.int32),
        bonds.ring_weights[rows],
        None if modulus is None else modulus[np.argsort(new_tet)],
    )


def _arrange_shells(shells: Shells | None, new_vertex: Ints) -> ShellArrays | None:
    """Return the triangles of a shell in the order of their lowest particles."""
    if shells is None:
        return None
    points = new_vertex[shells.points]
    corners = np.sort(points[:, :3], axis=1)
    order = np.lexsort((corners[:, 2], corners[:, 1], corners[:, 0])).astype(np.int32)
    return ShellArrays(
        order,
        points[order],
        shells.rest_inverse[order],
        shells.lame[order],
        shells.bending[order],
        shells.bending_damping[order, None],
    )


def blocks_of(rows: NDArray[np.generic], width: int, fill: float) -> NDArray[np.generic]:
    """Return rows (m, width) in the layout (blocks, width, LANES), flat and padded with `fill`."""
    block_count = -(-len(rows) // LANES)
    padded = np.full((block_count * LANES, width), fill, dtype=rows.dtype)
    padded[: len(rows)] = rows.reshape(len(rows), width)
    return np.ascontiguousarray(padded.reshape(block_count, LANES, width).transpose(0, 2, 1)).reshape(-1)
