# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Compute smooth normals, and project triangles into an image.

A triangle has the homogeneous corners v0, v1, v2 = (u d, v d, d). It covers the pixel (u, v) if the three
numbers E_i . (u, v, 1) are positive, where E_i is the cross product of the two other corners. This also holds
for corners behind the camera, so no clipping is needed. In an orthographic projection, d = 1.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.render.kernel_types import TILE, int_rows, ints, matrix, row_vec3, rows

PLANE = 12
"""Number of coefficients per triangle. The three edges and the depth are functions a u + b v + c of the
pixel, with three coefficients each."""

OVERLAP = 0.01
"""Distance by which each triangle is enlarged [pixels]. It exceeds the rounding errors of edges, so that no
seams appear between triangles."""


@ti.kernel
def compute_normals(positions: rows, triangles: int_rows, normals: rows):
    """Compute smooth unit normals of the vertices. Each triangle is weighted by its area."""
    ti.loop_config(serialize=True)
    for v in range(positions.shape[0]):
        for k in ti.static(range(3)):
            normals[v, k] = 0.0
    ti.loop_config(serialize=True)
    for t in range(triangles.shape[0]):
        a = row_vec3(positions, triangles[t, 0])
        b = row_vec3(positions, triangles[t, 1])
        c = row_vec3(positions, triangles[t, 2])
        n = (b - a).cross(c - a)
        for corner in range(3):
            v = triangles[t, corner]
            for k in ti.static(range(3)):
                normals[v, k] = normals[v, k] + n[k]
    ti.loop_config(serialize=True)
    for v in range(positions.shape[0]):
        n = row_vec3(normals, v)
        n = n / ti.sqrt(ti.max(n.dot(n), 1e-30))
        for k in ti.static(range(3)):
            normals[v, k] = n[k]


@ti.kernel
def project_triangles(
    to_picture: matrix,
    near: ti.f32,
    width: ti.i32,
    height: ti.i32,
    positions: rows,
    triangles: int_rows,
    planes: rows,
    boxes: int_rows,
    tile_begin: ints,
) -> ti.i32:
    """Compute edges, depth and pixel box of each triangle, and count the triangles per tile.

    Args:
        to_picture: matrix from (x, y, z, 1) to (u d, v d, d, q d). Points with a larger q are in front.
        near: smallest d to draw.
        planes: out (m, 12), coefficients, see `PLANE`. The sum of the edges at (u, v) is 1 / d.
        boxes: out (m, 4), first and last column, first and last row [pixels]. The box is empty if the
            triangle faces away (its corners run clockwise in an image whose v points down) or is not visible.
        tile_begin: out, entry i is the number of triangles in tiles 0 to i - 1. Tiles are counted row by row.
    Returns: the number of triangles summed over all tiles.
    """
    for t in range(triangles.shape[0]):
        corners = ti.Matrix.zero(ti.f32, 3, 4)
        for i in range(3):
            p = row_vec3(positions, triangles[t, i])
            for k in ti.static(range(4)):
                corners[i, k] = (
                    to_picture[k, 0] * p.x
                    + to_picture[k, 1] * p.y
                    + to_picture[k, 2] * p.z
                    + to_picture[k, 3]
                )
        v0 = ti.Vector([corners[0, 0], corners[0, 1], corners[0, 2]])
        v1 = ti.Vector([corners[1, 0], corners[1, 1], corners[1, 2]])
        v2 = ti.Vector([corners[2, 0], corners[2, 1], corners[2, 2]])
        normal = (v1 - v0).cross(v2 - v0)
        determinant = normal.dot(v0)
        low_u, high_u, low_v, high_v = 1e9, -1e9, 1e9, -1e9  # these convert to integers without overflow
        for i in range(3):
            j = (i + 1) % 3
            d, e = corners[i, 2], corners[j, 2]
            if d >= near:
                u, v = corners[i, 0] / d, corners[i, 1] / d
                low_u, high_u = ti.min(low_u, u), ti.max(high_u, u)
                low_v, high_v = ti.min(low_v, v), ti.max(high_v, v)
            if (d >= near) != (e >= near):  # the box ends where the edge crosses the near plane
                s = (near - d) / (e - d)
                u = (corners[i, 0] + s * (corners[j, 0] - corners[i, 0])) / near
                v = (corners[i, 1] + s * (corners[j, 1] - corners[i, 1])) / near
                low_u, high_u = ti.min(low_u, u), ti.max(high_u, u)
                low_v, high_v = ti.min(low_v, v), ti.max(high_v, v)
        boxes[t, 0] = ti.i32(ti.floor(ti.max(low_u, 0.0)))
        boxes[t, 1] = ti.i32(ti.floor(ti.min(high_u, width - 1.0)))
        boxes[t, 2] = ti.i32(ti.floor(ti.max(low_v, 0.0)))
        boxes[t, 3] = ti.i32(ti.floor(ti.min(high_v, height - 1.0)))
        if determinant < 0.0:
            edge0, edge1, edge2 = v1.cross(v2 - v1), v2.cross(v0 - v2), v0.cross(v1 - v0)
            q0, q1, q2 = corners[0, 3], corners[1, 3], corners[2, 3]
            depth = (q0 * normal + (q1 - q0) * edge1 + (q2 - q0) * edge2) / determinant
            for k in ti.static(range(3)):
                planes[t, k] = edge0[k] / determinant
                planes[t, 3 + k] = edge1[k] / determinant
                planes[t, 6 + k] = edge2[k] / determinant
                planes[t, 9 + k] = depth[k]
            for i in range(3):
                planes[t, 3 * i + 2] += OVERLAP * (ti.abs(planes[t, 3 * i]) + ti.abs(planes[t, 3 * i + 1]))
        else:
            boxes[t, 1] = -1

    tiles_across = (width + TILE - 1) // TILE
    ti.loop_config(serialize=True)
    for tile in range(tile_begin.shape[0]):
        tile_begin[tile] = 0
    ti.loop_config(serialize=True)
    for t in range(triangles.shape[0]):
        if boxes[t, 0] <= boxes[t, 1] and boxes[t, 2] <= boxes[t, 3]:
            for y in range(boxes[t, 2] // TILE, boxes[t, 3] // TILE + 1):
                for x in range(boxes[t, 0] // TILE, boxes[t, 1] // TILE + 1):
                    tile = y * tiles_across + x + 1
                    tile_begin[tile] = tile_begin[tile] + 1
    ti.loop_config(serialize=True)
    for tile in range(1, tile_begin.shape[0]):
        tile_begin[tile] = tile_begin[tile] + tile_begin[tile - 1]
    return tile_begin[tile_begin.shape[0] - 1]
