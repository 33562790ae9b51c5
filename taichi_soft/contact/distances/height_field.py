"""Signed distance from ground that is defined by heights on a regular grid, with two triangles per cell.

The ground is solid down to infinity. Within half a cell of the ground, the distance is exact: it is computed
from the triangles around the nearest node. Farther away, the distance is a lower bound, so that a ray can
advance by it over ground of any slope.
"""

from taichi_soft.contact.distances.direction import length_and_direction
from taichi_soft.contact.distances.nearest_point import nearest_on_triangle
from taichi_soft.core.runtime import ti

NEAREST = 1e-3
"""Distance from the ground, in cells, below which rounding makes the direction from the ground inaccurate.
The distance function then returns the normal of the ground."""


@ti.func
def _height(samples: ti.template(), resolution, offset, i, j):
    return samples[offset + i * resolution[1] + j]


@ti.func
def _ground(samples: ti.template(), resolution, offset, u, v, spacing):
    """Return the height [m] and the normal of the ground at (u, v), in cells from the first node."""
    i = ti.max(0, ti.min(resolution[0] - 2, int(u)))
    j = ti.max(0, ti.min(resolution[1] - 2, int(v)))
    s, t = u - i, v - j
    near = _height(samples, resolution, offset, i, j)
    far = _height(samples, resolution, offset, i + 1, j + 1)
    # The diagonal of a cell runs from the cell's first node to its last node.
    side = _height(samples, resolution, offset, i + int(s >= t), j + int(s < t))
    rise = ti.Vector([far - side, side - near])
    if s >= t:
        rise = ti.Vector([side - near, far - side])
    normal = ti.Vector([-rise[0], -rise[1], spacing]).normalized()
    return near + s * rise[0] + t * rise[1], normal


@ti.func
def _range_round_node(samples: ti.template(), resolution, offset, i, j):
    """Return the smallest and the largest height of the nodes of the four cells around node (i, j) [m]."""
    low = _height(samples, resolution, offset, i, j)
    high = low
    for k in range(9):
        a = ti.max(0, ti.min(resolution[0] - 1, i + k // 3 - 1))
        b = ti.max(0, ti.min(resolution[1] - 1, j + k % 3 - 1))
        height = _height(samples, resolution, offset, a, b)
        low, high = ti.min(low, height), ti.max(high, height)
    return low, high


@ti.func
def _vector_from_ground(samples: ti.template(), resolution, offset, i, j, spacing, p, longest):
    """Return the vector to `p` from the nearest point of the four cells around node (i, j) [m].

    `p` is relative to the node. The result is (0, 0, longest) if the vector is not shorter than `longest`.
    """
    vector = ti.Vector([0.0, 0.0, longest])
    base = _height(samples, resolution, offset, i, j)
    own_a, own_b = i - int(p[0] < 0.0), j - int(p[1] < 0.0)
    for k in range(8):
        # Check the cell below p first, then only the other cells that can contain a nearer point.
        turn_a, turn_b, is_upper = k // 4, k // 2 % 2, k % 2
        a = own_a + turn_a * (2 * (i - own_a) - 1)
        b = own_b + turn_b * (2 * (j - own_b) - 1)
        beside = ti.Vector([turn_a * p[0], turn_b * p[1]])
        is_cell = a >= 0 and b >= 0 and a < resolution[0] - 1 and b < resolution[1] - 1
        if is_cell and beside.norm_sqr() < vector.norm_sqr():
            c, d = a + 1 - is_upper, b + is_upper  # the corner that is not on the diagonal
            first = ti.Vector([(a - i) * spacing, (b - j) * spacing, 0.0])
            side = ti.Vector([(c - i) * spacing, (d - j) * spacing, 0.0])
            first[2] = _height(samples, resolution, offset, a, b) - base
            side[2] = _height(samples, resolution, offset, c, d) - base
            last = first + ti.Vector([spacing, spacing, 0.0])
            last[2] = _height(samples, resolution, offset, a + 1, b + 1) - base
            found = p - nearest_on_triangle(p, first, side, last)
            if found.norm_sqr() < vector.norm_sqr():
                vector = found
    return vector


@ti.func
def height_field_distance(samples: ti.template(), parameters, resolution, offset, x):
    """Return a lower bound of the signed distance [m], and the normal.

    Nothing is solid outside the rectangle. For a point outside, the bound combines the horizontal distance
    from the rectangle with the bound at the rectangle's nearest point. If this nearest point is below ground,
    half a cell or more is used as its bound. Bodies therefore touch no walls, and adjacent fields join
    without a seam.
    Parameters: spacing [m]; height of the lowest and of the highest node [m]; cosine of the steepest slope.
    """
    spacing, lowest, highest, cosine = parameters[0], parameters[1], parameters[2], parameters[3]
    last = ti.Vector([ti.cast(resolution[0] - 1, ti.f32), ti.cast(resolution[1] - 1, ti.f32)])
    half = 0.5 * spacing * last
    over = ti.max(-half, ti.min(half, x.xy))
    beside = x.xy - over
    u = over / spacing + 0.5 * last
    i = ti.max(0, ti.min(resolution[0] - 1, int(u[0] + 0.5)))
    j = ti.max(0, ti.min(resolution[1] - 1, int(u[1] + 0.5)))
    height, normal = _ground(samples, resolution, offset, u[0], u[1], spacing)
    low, high = _range_round_node(samples, resolution, offset, i, j)

    side, ground_gap, field_gap = 1.0, x[2] - high, x[2] - highest
    if x[2] < height:
        side, ground_gap, field_gap = -1.0, low - x[2], lowest - x[2]
    # All ground outside the four cells around the nearest node is at least `border` away.
    off_node = ti.Vector([u[0] - i, u[1] - j])
    border = spacing * (1.0 - ti.max(ti.abs(off_node[0]), ti.abs(off_node[1])))
    distance = ti.max(border, field_gap, ti.abs(x[2] - height) * cosine)
    if ground_gap < distance:
        p = ti.Vector([off_node[0] * spacing, off_node[1] * spacing, 0.0])
        p[2] = x[2] - _height(samples, resolution, offset, i, j)
        vector = _vector_from_ground(samples, resolution, offset, i, j, spacing, p, 2.0 * distance)
        length, direction = length_and_direction(vector, normal)
        if length < distance and length > NEAREST * spacing:
            normal = side * direction
        distance = ti.min(distance, length)

    outwards = ti.Vector([beside[0], beside[1], 0.0])
    if outwards.norm_sqr() > 0.0:
        away, across = length_and_direction(outwards, normal)
        slanted = length_and_direction(outwards + distance * normal, across)[1]
        if side < 0.0:
            distance, slanted = ti.max(distance, 0.5 * spacing), across
        # The two distances combine at right angles: at the rectangle's nearest point, all directions into the
        # rectangle are at 90 degrees or more from `outwards`.
        distance = ti.sqrt(away * away + distance * distance)
        side, normal = 1.0, slanted
    return side * distance, normal
