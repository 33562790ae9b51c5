# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Find the nearest triangle of every sample of an image.

Tiles are independent, and the triangles of a tile are processed in order, so the result is bit-identical for
any number of threads.
"""

from taichi_soft.core.runtime import ti
from taichi_soft.render.kernel_types import TILE, int_rows, ints, reals, rows, vec3


@ti.func
def row_limits(slope, inv_slope, start, low, high):
    """Return the subinterval of [low, high] in which slope x + start >= 0."""
    x = -start * inv_slope
    return ti.max(low, ti.select(slope >= 0.0, x, low)), ti.min(high, ti.select(slope < 0.0, x, high))


@ti.func
def inverse(slope):
    """Return 1 / slope; a slope of 0 counts as a tiny positive slope."""
    return 1.0 / ti.select(ti.abs(slope) < 1e-20, 1e-20, slope)


@ti.kernel
def rasterize(
    width: ti.i32,
    height: ti.i32,
    samples: rows,
    backdrop: vec3,
    nearest: ti.f32,
    clear_all: ti.i32,
    planes: rows,
    boxes: int_rows,
    tile_begin: ints,
    tile_next: ints,
    tile_triangles: ints,
    depth: reals,
    owner: ints,
):
    """Find the nearest triangle of each sample.

    Args:
        samples: (s, 2), positions of the samples relative to the centre of a pixel [pixels].
        backdrop: coefficients of the plane q = a u + b v + c. The plane hides everything behind it.
        nearest: largest q that is drawn.
        clear_all: 1 to clear tiles without triangles too, 0 to skip them.
        tile_next: scratch, one entry per tile.
        tile_triangles: scratch, at least as long as the result of `project_triangles`.
        depth: out, q of the nearest triangle. The nearest triangle has the largest q. Sample s of the pixel
            in column u and row v has the index (v * width + u) * s_count + s.
        owner: out, index of the nearest triangle at each sample, or -1.
    """
    tiles_across = (width + TILE - 1) // TILE
    ti.loop_config(serialize=True)
    for tile in range(tile_next.shape[0]):
        tile_next[tile] = tile_begin[tile]
    ti.loop_config(serialize=True)
    for t in range(planes.shape[0]):
        if boxes[t, 0] <= boxes[t, 1] and boxes[t, 2] <= boxes[t, 3]:
            for y in range(boxes[t, 2] // TILE, boxes[t, 3] // TILE + 1):
                for x in range(boxes[t, 0] // TILE, boxes[t, 1] // TILE + 1):
                    tile = y * tiles_across + x
                    tile_triangles[tile_next[tile]] = t
                    tile_next[tile] = tile_next[tile] + 1

    for tile in range(tile_next.shape[0]):
        left, top = tile % tiles_across * TILE, tile // tiles_across * TILE
        right, bottom = ti.min(left + TILE, width) - 1, ti.min(top + TILE, height) - 1
        count = samples.shape[0]
        if clear_all != 0 or tile_begin[tile + 1] > tile_begin[tile]:
            for y in range(top, bottom + 1):
                for x in range(left, right + 1):
                    for s in range(count):
                        i = (y * width + x) * count + s
                        u, v = x + 0.5 + samples[s, 0], y + 0.5 + samples[s, 1]
                        depth[i] = backdrop.x * u + backdrop.y * v + backdrop.z
                        owner[i] = -1
        for k in range(tile_begin[tile], tile_begin[tile + 1]):
            t = tile_triangles[k]
            a0, b0, c0 = planes[t, 0], planes[t, 1], planes[t, 2]
            a1, b1, c1 = planes[t, 3], planes[t, 4], planes[t, 5]
            a2, b2, c2 = planes[t, 6], planes[t, 7], planes[t, 8]
            aq, bq, cq = planes[t, 9], planes[t, 10], planes[t, 11]
            # If all four corners of a pixel are outside an edge, all samples of the pixel are outside.
            m0 = c0 + 0.5 * (ti.abs(a0) + ti.abs(b0) + a0 + b0)
            m1 = c1 + 0.5 * (ti.abs(a1) + ti.abs(b1) + a1 + b1)
            m2 = c2 + 0.5 * (ti.abs(a2) + ti.abs(b2) + a2 + b2)
            r0, r1, r2 = inverse(a0), inverse(a1), inverse(a2)
            box_left, box_right = ti.f32(ti.max(boxes[t, 0], left)), ti.f32(ti.min(boxes[t, 1], right))
            for y in range(ti.max(boxes[t, 2], top), ti.min(boxes[t, 3], bottom) + 1):
                low, high = row_limits(a0, r0, b0 * y + m0, box_left, box_right)
                low, high = row_limits(a1, r1, b1 * y + m1, low, high)
                low, high = row_limits(a2, r2, b2 * y + m2, low, high)
                first = ti.i32(ti.ceil(ti.min(low, box_right + 1.0)))
                last = ti.i32(ti.floor(ti.max(high, box_left - 1.0)))
                for x in range(first, last + 1):
                    u, v = x + 0.5, y + 0.5
                    e0, e1, e2 = a0 * u + b0 * v + c0, a1 * u + b1 * v + c1, a2 * u + b2 * v + c2
                    q = aq * u + bq * v + cq
                    for s in range(count):
                        du, dv = samples[s, 0], samples[s, 1]
                        inside = ti.min(
                            e0 + a0 * du + b0 * dv, e1 + a1 * du + b1 * dv, e2 + a2 * du + b2 * dv
                        )
                        i = (y * width + x) * count + s
                        q_here = q + aq * du + bq * dv
                        if (inside >= 0.0) & (q_here > depth[i]) & (q_here <= nearest):
                            depth[i] = q_here
                            owner[i] = t
