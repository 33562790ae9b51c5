"""Bodies for the pairwise laws, and the Voronoi faces of their edges."""

import bond_oracle as oracle
import numpy as np

from taichi_soft import TetMesh, box, sphere, voronoi_graph

POINTS, TETS = oracle.octahedron()
MESHES = {
    "ring": TetMesh(POINTS, oracle.shuffled_tets(TETS)),
    "box": box((1.0, 0.7, 1.3), (2, 1, 1)),
    "ball": sphere(0.7, 1),
}


def faces_of(mesh):
    """Return area and corners of the Voronoi face of each edge (i, j), or None if it has no face."""
    graph = voronoi_graph(mesh)
    found = {}
    for e, edge in enumerate(map(tuple, mesh.edges.tolist())):
        rows = np.flatnonzero(graph.corner_edge == e)
        corners = [(graph.corner_tet[row], graph.corner_weights[row]) for row in rows]
        found[edge] = (graph.areas[e], corners) if graph.areas[e] > 0 else None
    return found


FACES = {name: faces_of(mesh) for name, mesh in MESHES.items()}
