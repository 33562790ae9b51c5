"""Signed distance of a closed mesh at the nodes of a grid. The unit of all lengths is the cell, so that node
(i, j, k) is at (i, j, k).
"""

from taichi_soft.contact.distances.nearest_point import nearest_on_triangle
from taichi_soft.core.runtime import ti

STEPS = 4096
"""Number of lattice steps per cell. The coordinates x and y of vertices are rounded to integer steps. A line
along z through a node therefore passes an edge on the same side for both triangles of the edge, so that each
crossing counts exactly once."""


@ti.func
def _side(ax, ay, bx, by, x, y):
    """Return twice the signed area of the triangle a, b, (x, y), and True if (x, y) is left of the line ab.

    If the area is 0, the result is that of a point slightly to the right of (x, y).
    """
    area = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    is_left = area > 0
    if area == 0:
        is_left = (by < ay) or (by == ay and bx > ax)
    return area, is_left


@ti.kernel
def accumulate_crossings(
    lattice: ti.types.ndarray(dtype=ti.i64, ndim=3),
    heights: ti.types.ndarray(dtype=ti.f64, ndim=2),
    crossings: ti.types.ndarray(dtype=ti.i32, ndim=3),
):
    """Count the crossings of the surface with the segment from each node to the next node above.

    Args:
        lattice: x and y of the corners of each triangle in steps, (f, 3, 2).
        heights: z of the corners in cells, (f, 3).
        crossings: zeros, (nx, ny, nz). Each crossing adds 1 if the segment leaves the solid, -1 if it enters.
    """
    for f in range(lattice.shape[0]):
        ax, ay, bx, by = lattice[f, 0, 0], lattice[f, 0, 1], lattice[f, 1, 0], lattice[f, 1, 1]
        cx, cy = lattice[f, 2, 0], lattice[f, 2, 1]
        first_i, last_i = ti.min(ax, bx, cx) // STEPS, ti.max(ax, bx, cx) // STEPS
        first_j, last_j = ti.min(ay, by, cy) // STEPS, ti.max(ay, by, cy) // STEPS
        for i in range(ti.cast(first_i, ti.i32), ti.cast(last_i, ti.i32) + 1):
            for j in range(ti.cast(first_j, ti.i32), ti.cast(last_j, ti.i32) + 1):
                x, y = ti.cast(i, ti.i64) * STEPS, ti.cast(j, ti.i64) * STEPS
                area_a, left_a = _side(bx, by, cx, cy, x, y)
                area_b, left_b = _side(cx, cy, ax, ay, x, y)
                area_c, left_c = _side(ax, ay, bx, by, x, y)
                # A triangle seen edge-on has no area. Its neighbours count the crossing.
                is_seen = area_a + area_b + area_c != 0
                if is_seen and left_a == left_b and left_b == left_c:
                    a, b, c = ti.cast(area_a, ti.f64), ti.cast(area_b, ti.f64), ti.cast(area_c, ti.f64)
                    z = (a * heights[f, 0] + b * heights[f, 1] + c * heights[f, 2]) / (a + b + c)
                    below = ti.cast(ti.ceil(z), ti.i32) - 1
                    # Sums of integers do not depend on the order of the threads.
                    ti.atomic_add(crossings[i, j, below], ti.select(left_a, 1, -1))


@ti.func
def _box_gap_squared(boxes: ti.template(), node, p):
    """Return the squared distance of `p` from a box of the tree, 0 inside the box."""
    squared = 0.0
    for axis in ti.static(range(3)):
        gap = ti.max(boxes[node, axis] - p[axis], p[axis] - boxes[node, 3 + axis], 0.0)
        squared += gap * gap
    return squared


@ti.func
def _corner(corners: ti.template(), f, k):
    return ti.Vector([corners[f, k, 0], corners[f, k, 1], corners[f, k, 2]])


@ti.func
def _nearest_squared(corners: ti.template(), boxes: ti.template(), p, reach_squared):
    """Return the squared distance of `p` from the nearest triangle, at most `reach_squared`."""
    leaves = boxes.shape[0] // 2
    nearest = reach_squared
    node = 1
    while node > 0:
        is_near = _box_gap_squared(boxes, node, p) < nearest
        if is_near and node < leaves:
            node = 2 * node
        else:
            if is_near:
                f = node - leaves
                a, b, c = _corner(corners, f, 0), _corner(corners, f, 1), _corner(corners, f, 2)
                nearest = ti.min(nearest, (p - nearest_on_triangle(p, a, b, c)).norm_sqr())
            # Continue with the sibling of the nearest left child, which can be this node or an ancestor.
            while node % 2 == 1:
                node = node // 2
            if node > 0:
                node = node + 1
    return nearest


@ti.kernel
def compute_grid_distances(
    corners: ti.types.ndarray(dtype=ti.f32, ndim=3),
    boxes: ti.types.ndarray(dtype=ti.f32, ndim=2),
    windings: ti.types.ndarray(dtype=ti.i32, ndim=3),
    distances: ti.types.ndarray(dtype=ti.f32, ndim=3),
):
    """Compute the exact distance of each node from the nearest triangle, negative inside.

    Args:
        corners: corners of the triangles, (f, 3, 3).
        boxes: boxes of a binary tree over the triangles, (2 n, 6), see `triangle_tree`.
        windings: crossings from `accumulate_crossings`. Receives the winding number around each node.
        distances: receives the distances, (nx, ny, nz).
    """
    for row in range(distances.shape[0] * distances.shape[1]):
        i, j = row // distances.shape[1], row % distances.shape[1]
        winding = 0
        reach = 1e15
        for step in range(distances.shape[2]):
            k = distances.shape[2] - 1 - step
            winding = winding + windings[i, j, k]
            windings[i, j, k] = winding
            p = ti.Vector([ti.cast(i, ti.f32), ti.cast(j, ti.f32), ti.cast(k, ti.f32)])
            distance = ti.sqrt(_nearest_squared(corners, boxes, p, reach * reach))
            distances[i, j, k] = ti.select(winding > 0, -distance, distance)
            reach = distance + 1.001  # the next node is one cell away
