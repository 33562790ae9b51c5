"""Bodies of a world as flat arrays with offsets: everything the Taichi fields will hold, in numpy."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taichi_soft.constants import LANES
from taichi_soft.errors import MeshError
from taichi_soft.laws import ElementModel
from taichi_soft.materials import Material
from taichi_soft.meshing import TetMesh, renumbered, spatial_order, tet_order
from taichi_soft.types import DampingModel

SHORTEST_EDGE = 1e-6
"""[m]; volumes of smaller tetrahedra run out of float32's range."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class BodyDescription:
    """One body as the user added it."""

    mesh: TetMesh
    material: Material
    model: ElementModel
    position: Floats  # (3,) [m], where the mesh's origin goes
    rotation: Floats  # (3, 3)
    velocity: Floats  # (3,) [m/s]

    @property
    def start_positions(self) -> Floats:
        """Vertices in the world, (n, 3) [m], in the caller's order."""
        return np.asarray(self.mesh.vertices @ self.rotation.T + self.position)


@dataclass(frozen=True)
class BodyArrays:
    """One body in the order in which the kernels walk it."""

    order: Ints  # (n,) caller's index of each particle
    rank: Ints  # (n,) particle of each of the caller's vertices
    start_position: Floats  # (n, 3) [m]
    start_velocity: Floats  # (n, 3) [m/s]
    mass: Floats  # (n,) [kg]
    tet_vertices: Ints  # (m, 4) into the particles of this body
    tet_order: Ints  # (m,) caller's index of each tetrahedron
    rest_inverse: Floats  # (m, 3, 3) [1/m]
    lame: Floats  # (m, 2) lambda, mu [Pa]
    tet_damping: Floats  # (m,) [N s/m]
    edge_vertices: Ints  # (k, 2)
    edge_damping: Floats  # (k,) [N s/m]


@dataclass
class Ranges:
    """Where the body's rows lie in the world's flat arrays."""

    particles: tuple[int, int] = (0, 0)
    edges: tuple[int, int] = (0, 0)
    blocks: tuple[int, int] = (0, 0)


@dataclass
class Scene:
    """All bodies, one behind the other."""

    bodies: list[BodyArrays] = field(default_factory=list)
    ranges: list[Ranges] = field(default_factory=list)
    particle_count: int = 0
    edge_count: int = 0
    block_count: int = 0

    def append(self, body: BodyArrays) -> None:
        """Give `body` the next free rows."""
        blocks = -(-len(body.tet_vertices) // LANES)
        self.ranges.append(
            Ranges(
                (self.particle_count, self.particle_count + len(body.mass)),
                (self.edge_count, self.edge_count + len(body.edge_vertices)),
                (self.block_count, self.block_count + blocks),
            )
        )
        self.bodies.append(body)
        self.particle_count += len(body.mass)
        self.edge_count += len(body.edge_vertices)
        self.block_count += blocks


def edge_damping(mesh: TetMesh, tet_damping: Floats) -> Floats:
    """Damping of each edge: the mean over the tetrahedra that share it, (k,) [N s/m]."""
    total = np.bincount(mesh.tet_edges.ravel(), np.repeat(tet_damping, 6), minlength=len(mesh.edges))
    return total / mesh.edge_valence


def vertex_masses(mesh: TetMesh, density: Floats) -> Floats:
    """A quarter of the mass of each neighbouring tetrahedron, (n,) [kg] (thesis chapter 6)."""
    quarter = np.repeat(mesh.volumes * density / 4.0, 4)
    return np.bincount(mesh.tets.ravel(), quarter, minlength=len(mesh.vertices)).astype(np.float64)


def rest_inverses(mesh: TetMesh) -> Floats:
    """A^-1 of thesis eq. 6.1 for every tetrahedron, (m, 3, 3) [1/m]."""
    corners = mesh.vertices[mesh.tets]
    shapes = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    return np.asarray(np.linalg.inv(shapes))


def require_size(mesh: TetMesh) -> None:
    """Raises: MeshError for edges below `SHORTEST_EDGE`."""
    shortest = float(mesh.edge_lengths.min())
    if shortest < SHORTEST_EDGE:
        raise MeshError(
            f"the shortest edge is {shortest:.3g} m: scale the mesh (in metres) to {SHORTEST_EDGE:g} or more"
        )


def arrange(description: BodyDescription) -> BodyArrays:
    """Reorder a body along a space-filling curve, so that neighbours share cache lines."""
    mesh = description.mesh
    count = len(mesh.tets)
    material = description.material
    order = spatial_order(mesh.vertices)
    tets = tet_order(mesh.tets, order)
    new_index = renumbered(order)
    edges = np.sort(new_index[mesh.edges], axis=1)
    edge_order = np.lexsort((edges[:, 1], edges[:, 0]))
    tet_damping = material.per_tet("damping", count)
    is_edge_damped = description.model.damping_model is DampingModel.EDGE
    lame = np.stack([material.per_tet("lame_lambda", count), material.per_tet("lame_mu", count)], axis=1)
    return BodyArrays(
        order=order,
        rank=new_index,
        start_position=description.start_positions[order],
        start_velocity=np.tile(description.velocity, (len(order), 1)),
        mass=vertex_masses(mesh, material.per_tet("density", count))[order],
        tet_vertices=new_index[mesh.tets[tets]],
        tet_order=tets,
        rest_inverse=rest_inverses(mesh)[tets],
        lame=lame[tets],
        tet_damping=tet_damping[tets],
        edge_vertices=edges[edge_order],
        edge_damping=edge_damping(mesh, tet_damping)[edge_order] * is_edge_damped,
    )


def blocks_of(rows: NDArray[np.generic], width: int, fill: float) -> NDArray[np.generic]:
    """Rows (m, width) as (blocks, width, LANES), flattened: lane beside lane, padded with `fill`."""
    block_count = -(-len(rows) // LANES)
    padded = np.full((block_count * LANES, width), fill, dtype=rows.dtype)
    padded[: len(rows)] = rows.reshape(len(rows), width)
    return np.ascontiguousarray(padded.reshape(block_count, LANES, width).transpose(0, 2, 1)).reshape(-1)
