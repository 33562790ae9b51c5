"""Triangles of height fields and meshes, made from the grids of their colliders.

A cell of a height field has two triangles. A cell of a mesh is divided into six tetrahedra, in which the
signed distance is linear, so that the surface in each is a triangle or a quadrilateral.
"""

from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.core.math.quaternion import turned, turned_back
from taichi_soft.core.math.triangle import closest_point_on_triangle
from taichi_soft.core.runtime import ti
from taichi_soft.queries.kernels.convex import can_touch, core_extent, touch_triangle

CHUNK = 4.0
"""Length of the parts into which a path along a grid is divided, in cells."""

LEAST_SAMPLE = 2e-3
"""Smallest distance at a node, in cells. A surface through a node would have triangles without area."""

_Vector7 = ti.types.vector(7, ti.f32)
_Vector8 = ti.types.vector(8, ti.f32)


@ti.func
def grid_start(kind, parameters, resolution):
    """Return the position of a grid's first node, with z = 0 for a height field, and the size of a cell."""
    cell = parameters[0]
    low = ti.Vector([-0.5 * cell * (resolution[0] - 1), -0.5 * cell * (resolution[1] - 1), 0.0])
    if kind == ShapeKind.MESH:
        cell = parameters[3]
        low = ti.Vector([parameters[0], parameters[1], parameters[2]])
    return low, cell


@ti.func
def _better(casts, core, half, radius, d, a, b, c, best, reach):
    """Return `best`, or the result for a triangle if that is nearer: see `touch_triangle`."""
    nearest = best
    if casts == 1:
        if can_touch(reach, d, a, b, c, best[0]):
            found = touch_triangle(core, half, radius, d, a, b, c, best[0])
            if found[0] < best[0]:
                nearest = found
    else:
        w = closest_point_on_triangle(a * 0.0, a, b, c)
        place = a * w[0] + b * w[1] + c * w[2]
        if place.norm() < best[0]:
            normal = (b - a).cross(c - a).normalized(1e-30)
            for k in ti.static(range(3)):
                nearest[1 + k], nearest[4 + k] = normal[k], place[k]
            nearest[0] = place.norm()
    return nearest


@ti.func
def _crossing(x, s, y, t):
    """Return the point between x and y at which the distance is 0, from the distances s and t there."""
    return x + (y - x) * (s / (s - t))


@ti.real_func
def search_cells(
    samples: ti.template(),
    kind: ti.i32,
    parameters: _Vector8,
    resolution: ti.math.ivec3,
    offset: ti.i32,
    first: ti.math.ivec3,
    last: ti.math.ivec3,
    casts: ti.i32,
    core: ti.i32,
    half: ti.math.vec3,
    radius: ti.f32,
    d: ti.math.vec3,
    origin: ti.math.vec3,
    turn: ti.math.vec4,
    best: _Vector7,
    reach: ti.f32,
) -> _Vector7:
    """Return `best`, or a nearer result on the triangles of the cells from `first` to `last`.

    Args:
        casts: 1 to cast a shape, 0 to find the point closest to `origin`.
        core, half, radius, d: see `touch_triangle`.
        origin: centre of the shape in the frame of the collider [m].
        turn: rotation of the shape in the frame of the collider.
        best: the nearest result so far: see `touch_triangle`.
        reach: radius of a sphere around the shape [m].
    """
    low, cell = grid_start(kind, parameters, resolution)
    low -= origin
    nearest = best
    for i in range(first[0], last[0] + 1):
        for j in range(first[1], last[1] + 1):
            if kind == ShapeKind.HEIGHT_FIELD:
                row = offset + i * resolution[1] + j
                step = ti.Vector([cell, cell])
                a = ti.Vector([low[0] + i * cell, low[1] + j * cell, low[2] + samples[row]])
                c = ti.Vector([a.x + step.x, a.y + step.y, low[2] + samples[row + resolution[1] + 1]])
                for upper in range(2):
                    b = ti.Vector([a.x + step.x, a.y, low[2] + samples[row + resolution[1]]])
                    if upper == 1:
                        b = ti.Vector([a.x, a.y + step.y, low[2] + samples[row + 1]])
                    p, q = ti.select(upper == 1, c, b), ti.select(upper == 1, b, c)
                    nearest = _better(
                        casts,
                        core,
                        half,
                        radius,
                        d,
                        turned_back(turn, a),
                        turned_back(turn, p),
                        turned_back(turn, q),
                        nearest,
                        reach,
                    )
            else:
                for k in range(first[2], last[2] + 1):
                    row = offset + (i * resolution[1] + j) * resolution[2] + k
                    middle = low + cell * ti.Vector([i + 0.5, j + 0.5, k + 0.5])
                    is_near = casts == 1 or middle.norm() - cell < nearest[0]
                    # The distance changes by at most the diagonal of a cell within the cell.
                    if is_near and ti.abs(samples[row]) <= 2.0 * cell:
                        for order in range(6):
                            # The corners of a tetrahedron are a path along three edges of the cell.
                            one = order // 2
                            two = (one + 1 + order % 2) % 3
                            x, s = ti.Matrix.zero(ti.f32, 4, 3), ti.Vector.zero(ti.f32, 4)
                            at = ti.Vector([0, 0, 0])
                            outside = 0
                            for v in ti.static(range(4)):
                                if ti.static(v > 0):
                                    axis = ti.select(v == 1, one, ti.select(v == 2, two, 3 - one - two))
                                    for m in ti.static(range(3)):
                                        if axis == m:
                                            at[m] = 1
                                s[v] = samples[row + (at[0] * resolution[1] + at[1]) * resolution[2] + at[2]]
                                if ti.abs(s[v]) < LEAST_SAMPLE * cell:
                                    s[v] = LEAST_SAMPLE * cell
                                outside += int(s[v] > 0.0)
                                x[v, 0] = low[0] + (i + at[0]) * cell
                                x[v, 1] = low[1] + (j + at[1]) * cell
                                x[v, 2] = low[2] + (k + at[2]) * cell
                            if outside > 0 and outside < 4:
                                for u, v in ti.static(((0, 1), (2, 3), (0, 2), (1, 3), (1, 2))):
                                    if s[u] < 0.0 and s[v] >= 0.0:  # corners outside come first
                                        s[u], s[v] = s[v], s[u]
                                        for m in ti.static(range(3)):
                                            x[u, m], x[v, m] = x[v, m], x[u, m]
                                x0, x1 = (
                                    ti.Vector([x[0, 0], x[0, 1], x[0, 2]]),
                                    ti.Vector([x[1, 0], x[1, 1], x[1, 2]]),
                                )
                                x2, x3 = (
                                    ti.Vector([x[2, 0], x[2, 1], x[2, 2]]),
                                    ti.Vector([x[3, 0], x[3, 1], x[3, 2]]),
                                )
                                a, b = _crossing(x0, s[0], x2, s[2]), _crossing(x0, s[0], x3, s[3])
                                c, e = _crossing(x1, s[1], x3, s[3]), _crossing(x1, s[1], x2, s[2])
                                if outside == 1:
                                    a, b, c = _crossing(x0, s[0], x1, s[1]), a, b
                                elif outside == 3:
                                    a, b, c = b, c, _crossing(x2, s[2], x3, s[3])
                                for part in range(ti.select(outside == 2, 2, 1)):
                                    p, q = ti.select(part == 0, b, c), ti.select(part == 0, c, e)
                                    if (p - a).cross(q - a).dot(x0 - a) < 0.0:  # outward
                                        p, q = q, p
                                    nearest = _better(
                                        casts,
                                        core,
                                        half,
                                        radius,
                                        d,
                                        turned_back(turn, a),
                                        turned_back(turn, p),
                                        turned_back(turn, q),
                                        nearest,
                                        reach,
                                    )
    return nearest


@ti.func
def _cells_between(lower, upper, low, cell, resolution, kind):
    """Return the first and the last cell that a box can overlap."""
    last = ti.max(resolution - 2, 0)
    if kind == ShapeKind.HEIGHT_FIELD:
        last[2] = 0
    far = ti.cast(last + 1, ti.f32)
    first_cell = ti.cast(ti.max(0.0, ti.min(far, (lower - low) / cell)), ti.i32)
    last_cell = ti.cast(ti.max(-1.0, ti.min(far, (upper - low) / cell)), ti.i32)
    return ti.max(0, first_cell), ti.max(-1, ti.min(last, last_cell))


@ti.func
def touch_grid(
    samples: ti.template(),
    kind,
    parameters,
    resolution,
    offset,
    core,
    half,
    radius,
    d,
    origin,
    turn,
    best,
    reach,
):
    """Return `best`, or a nearer result on a height field or mesh: see `search_cells`."""
    low, cell = grid_start(kind, parameters, resolution)
    along = ti.Vector([0.0, 0.0, 0.0])
    for m in ti.static(range(3)):
        along[m] = d[m]
    along = turned(turn, along)
    sides = ti.Vector([0.0, 0.0, 0.0])  # half of the box around the shape, in the frame of the collider
    for m in ti.static(range(3)):
        axis = ti.Vector([0.0, 0.0, 0.0])
        axis[m] = 1.0
        sides[m] = radius + core_extent(core, half, turned_back(turn, axis)) + 0.1 * cell
    high = low + cell * ti.cast(resolution - 1, ti.f32)
    if kind == ShapeKind.HEIGHT_FIELD:
        low[2], high[2] = parameters[1], parameters[2]
    inv = 1.0 / ti.select(ti.abs(along) < 1e-12, 1e-12, along)
    one, other = (low - reach - cell - origin) * inv, (high + reach + cell - origin) * inv
    at = ti.max(ti.min(one, other).max(), 0.0)
    end = ti.max(one, other).min()
    if kind == ShapeKind.HEIGHT_FIELD:
        low[2] = 0.0
    chunk = ti.max(CHUNK * cell, 0.25 * reach)
    nearest = best
    while at <= end and at < nearest[0]:
        x = origin + at * along
        distance, _ = signed_distance(samples, kind, parameters, resolution, offset, x)
        spare = ti.abs(distance) - reach - cell
        if spare > cell:
            at += spare
        else:
            y = x + chunk * along
            first, last = _cells_between(
                ti.min(x, y) - sides, ti.max(x, y) + sides, low, cell, resolution, kind
            )
            nearest = search_cells(
                samples,
                kind,
                parameters,
                resolution,
                offset,
                first,
                last,
                1,
                core,
                half,
                radius,
                d,
                origin,
                turn,
                nearest,
                reach,
            )
            at += chunk
    return nearest


@ti.func
def closest_on_grid(samples: ti.template(), kind, parameters, resolution, offset, x, best):
    """Return `best`, or a nearer result on a height field or mesh: see `search_cells`."""
    low, cell = grid_start(kind, parameters, resolution)
    high = low + cell * ti.cast(resolution - 1, ti.f32)
    inside = ti.max(low, ti.min(high, x))
    # An upper bound: the nearest node of a height field, or the surface nearest to a point of the grid.
    room = ti.cast(0.0, ti.f32)
    if kind == ShapeKind.HEIGHT_FIELD:
        i, j = int((inside.x - low.x) / cell + 0.5), int((inside.y - low.y) / cell + 0.5)
        node = ti.Vector([low.x + i * cell, low.y + j * cell, samples[offset + i * resolution[1] + j]])
        room = (x - node).norm() + 0.1 * cell
    else:
        distance, _ = signed_distance(samples, kind, parameters, resolution, offset, inside)
        room = (x - inside).norm() + ti.abs(distance) + 2.0 * cell
    room = ti.min(best[0], room)
    first, last = _cells_between(x - room, x + room, low, cell, resolution, kind)
    zero = ti.Vector([0.0, 0.0, 0.0])
    return search_cells(
        samples,
        kind,
        parameters,
        resolution,
        offset,
        first,
        last,
        0,
        0,
        zero,
        0.0,
        zero,
        x,
        ti.Vector([0.0, 0.0, 0.0, 1.0]),
        best,
        0.0,
    )
