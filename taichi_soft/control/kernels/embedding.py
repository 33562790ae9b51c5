"""Embed points in tetrahedra, in float64."""

from taichi_soft.control.kernels.grab_patch import dot
from taichi_soft.core.math.rows import row_at
from taichi_soft.core.runtime import ti


@ti.kernel
def embed_points(
    points: ti.types.ndarray(dtype=ti.f64, ndim=2),
    x: ti.types.ndarray(dtype=ti.f64, ndim=2),
    tets: ti.types.ndarray(dtype=ti.i32, ndim=2),
    corners: ti.types.ndarray(dtype=ti.i32, ndim=2),
    weights: ti.types.ndarray(dtype=ti.f64, ndim=2),
):
    """Find for each point the tetrahedron in which the smallest weight of the point is largest.

    Args:
        points: points to embed, (k, 3) [m].
        x: positions of the vertices, (n, 3) [m].
        tets: vertices of each tetrahedron, (m, 4). Tetrahedra without volume are skipped.
        corners: (k, 4), receives the vertices of each point's tetrahedron.
        weights: (k, 4), receives the barycentric coordinates; -1e30 if no tetrahedron has a volume.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        for i in range(points.shape[0]):
            for k in ti.static(range(4)):
                corners[i, k], weights[i, k] = 0, -1e30
        for t in range(tets.shape[0]):
            start = row_at(x, tets[t, 0], 0)
            a, b, c = row_at(x, tets[t, 1], 0), row_at(x, tets[t, 2], 0), row_at(x, tets[t, 3], 0)
            a, b, c = a - start, b - start, c - start
            bc, ca, ab = b.cross(c), c.cross(a), a.cross(b)
            volume6 = dot(a, bc)
            if ti.abs(volume6) > 1e-30:
                bc, ca, ab = bc / volume6, ca / volume6, ab / volume6
                for i in range(points.shape[0]):
                    arm = row_at(points, i, 0) - start
                    rest = ti.Vector([dot(bc, arm), dot(ca, arm), dot(ab, arm)])
                    found = ti.Vector([1.0 - (rest.x + rest.y + rest.z), rest.x, rest.y, rest.z])
                    least = ti.min(weights[i, 0], weights[i, 1], weights[i, 2], weights[i, 3])
                    if found.min() > least:
                        for k in ti.static(range(4)):
                            corners[i, k], weights[i, k] = tets[t, k], found[k]
