"""First touch of a moving convex shape with a triangle, by conservative advancement.

All points and directions are in the frame of the shape, with its centre at the origin. A shape is a core (a
point, a segment of the z axis, or a box along the axes) and a radius around it. A triangle can also be a
segment or a point, so that spheres and capsules are triangles with a radius.

The distance of two convex sets is a convex function of the displacement along a line. The shape can therefore
advance to the plane that separates it from the triangle, and never moves past the first touch.
"""

from taichi_soft.core.math.segment import closest_points_on_segments
from taichi_soft.core.math.triangle import closest_point_on_triangle, triangle_touches_box
from taichi_soft.core.runtime import ti

POINT, SEGMENT, BLOCK = 0, 1, 2
"""Kinds of cores: a point, a segment of the z axis, a box."""

MAX_ADVANCES = 40
"""Largest number of advances. Newton's method on a convex function rarely needs ten."""

TOUCH = 1e-6
"""Distance at which a shape touches [m]."""

TOUCH_PART = 5e-7
"""The same, as a fraction of the coordinates. It is a few times the resolution of float32."""

CLEAR = 100.0
"""Distance of the cores, in touching distances, above which rounding does not disturb the normal."""

LEAST_APPROACH = 1e-6
"""Smallest part of the motion along the normal. A shape that moves along a surface does not touch it."""

BACK_SIDE = -1e-3
"""Cosine between the normal of the touch and that of the triangle below which the back of the triangle is
touched. A shape inside a solid leaves the solid."""

NO_HIT = 3.4e38

_Vector6 = ti.types.vector(6, ti.f32)
_Vector7 = ti.types.vector(7, ti.f32)


@ti.func
def core_extent(kind, half, direction):
    """Return the largest coordinate of the core along a direction [m]."""
    extent = 0.0
    if kind == SEGMENT:
        extent = half.z * ti.abs(direction.z)
    elif kind == BLOCK:
        extent = half.dot(ti.abs(direction))
    return extent


@ti.func
def core_radius(kind, half):
    """Return the radius of the sphere around the core [m]."""
    radius = 0.0
    if kind == SEGMENT:
        radius = half.z
    elif kind == BLOCK:
        radius = half.norm()
    return radius


@ti.real_func
def closest_to_core(
    kind: ti.i32, half: ti.math.vec3, a: ti.math.vec3, b: ti.math.vec3, c: ti.math.vec3
) -> _Vector6:
    """Return the vector to the core from the nearest point of a triangle, then that point [m].

    The vector is zero if a box overlaps the triangle.
    Args:
        kind: POINT, SEGMENT or BLOCK.
        half: half of the lengths of a box; half of the length of a segment in z [m].
    """
    zero = ti.Vector([0.0, 0.0, 0.0])
    w = closest_point_on_triangle(zero, a, b, c)
    place = a * w[0] + b * w[1] + c * w[2]
    vector = -place
    if kind == SEGMENT:
        low, along = ti.Vector([0.0, 0.0, -half.z]), ti.Vector([0.0, 0.0, 2.0 * half.z])
        normal = (b - a).cross(c - a)
        from_low, from_high = normal.dot(low - a), normal.dot(low + along - a)
        crossing = from_low / ti.select(from_low == from_high, 1.0, from_low - from_high)
        for k in range(3):  # both ends, and the crossing with the plane
            s = ti.select(k == 2, ti.max(0.0, ti.min(1.0, crossing)), ti.cast(k, ti.f32))
            x = low + s * along
            weights = closest_point_on_triangle(x, a, b, c)
            near = a * weights[0] + b * weights[1] + c * weights[2]
            if (x - near).norm_sqr() < vector.norm_sqr():
                vector, place = x - near, near
        p, q = a, b
        for _ in range(3):
            s, t = closest_points_on_segments(low, along, p, q - p)
            x, near = low + s * along, p + t * (q - p)
            if (x - near).norm_sqr() < vector.norm_sqr():
                vector, place = x - near, near
            p, q = q, ti.select(_ == 0, c, a)
    elif kind == BLOCK:
        if triangle_touches_box(a, b, c, half):
            vector, place = zero, ti.max(-half, ti.min(half, place))
        else:
            p, q = a, b
            for e in range(3):
                x = ti.max(-half, ti.min(half, p))
                if (x - p).norm_sqr() < vector.norm_sqr() or e == 0:
                    vector, place = x - p, p
                p, q = q, ti.select(e == 0, c, a)
            for k in range(8):
                x = half * ti.Vector([2.0 * (k & 1) - 1.0, 1.0 * (k & 2) - 1.0, 0.5 * (k & 4) - 1.0])
                weights = closest_point_on_triangle(x, a, b, c)
                near = a * weights[0] + b * weights[1] + c * weights[2]
                if (x - near).norm_sqr() < vector.norm_sqr():
                    vector, place = x - near, near
            for k in range(12):
                axis, others = k // 4, k % 4
                side = ti.Vector([2.0 * (others & 1) - 1.0, 1.0 * (others & 2) - 1.0])
                start, along = half, ti.Vector([0.0, 0.0, 0.0])
                for i in ti.static(range(3)):
                    if axis == i:
                        start[i], along[i] = -half[i], 2.0 * half[i]
                        start[(i + 1) % 3] = side[0] * half[(i + 1) % 3]
                        start[(i + 2) % 3] = side[1] * half[(i + 2) % 3]
                p, q = a, b
                for e in range(3):
                    s, t = closest_points_on_segments(start, along, p, q - p)
                    x, near = start + s * along, p + t * (q - p)
                    if (x - near).norm_sqr() < vector.norm_sqr():
                        vector, place = x - near, near
                    p, q = q, ti.select(e == 0, c, a)
    return ti.Vector([vector.x, vector.y, vector.z, place.x, place.y, place.z])


@ti.func
def can_touch(reach, d, a, b, c, best):
    """True if a sphere of the radius `reach` around the shape can touch a triangle before `best` [m]."""
    middle = (a + b + c) / 3.0
    size = ti.sqrt(ti.max((a - middle).norm_sqr(), (b - middle).norm_sqr(), (c - middle).norm_sqr())) + reach
    along = middle.dot(d)
    beside = middle - along * d
    slack = size + TOUCH_PART * (middle.norm() + size)
    return beside.norm_sqr() <= slack * slack and along >= -slack and along - slack < best


@ti.real_func
def touch_triangle(
    kind: ti.i32,
    half: ti.math.vec3,
    radius: ti.f32,
    d: ti.math.vec3,
    a: ti.math.vec3,
    b: ti.math.vec3,
    c: ti.math.vec3,
    best: ti.f32,
) -> _Vector7:
    """Return distance until the first touch, normal from the triangle to the shape, place of the touch.

    The distance is negative if the two overlap at the start: the depth along the normal. It is `NO_HIT` if
    they touch later than `best`, if the shape moves away from the triangle, or if it touches the back.
    Args:
        half: see `closest_to_core`.
        radius: radius around the core, and around the triangle [m].
        d: unit vector of the motion.
        best: largest distance [m].
    """
    distance, at = NO_HIT, 0.0
    face = (b - a).cross(c - a)
    normal, place = -d, a
    scale = ti.max(ti.abs(a).max(), ti.abs(b).max(), ti.abs(c).max()) + radius
    closest, is_open = TOUCH + TOUCH_PART * scale, 1
    count, back = 0, 0.0
    while is_open == 1:
        shift = at * d
        found = closest_to_core(kind, half, a - shift, b - shift, c - shift)
        vector = ti.Vector([found[0], found[1], found[2]])
        place = ti.Vector([found[3], found[4], found[5]]) + shift
        length = vector.norm()
        gap = length - radius
        depth = gap
        ahead = normal  # normal of the plane between the two
        if length > closest:
            ahead = vector / length
            if count == 0 or length > CLEAR * closest:
                normal = ahead
        elif count == 0 and face.norm_sqr() > 0.0:
            # Rounding decides the direction between sets that touch or overlap: take the side of the face.
            normal = face.normalized()
            ahead = normal
            depth = -(radius + core_extent(kind, half, normal) + normal.dot(a))
        approach = -d.dot(ahead)
        if length == 0.0 and count > 0 and back == 0.0:
            # Rounding made a box overlap: its nearest point is that a little earlier.
            back = 4.0 * closest
            at -= back
        elif back > 0.0:
            distance, is_open = at + back, 0
        elif approach < LEAST_APPROACH:
            is_open = 0
        elif gap <= closest or count == MAX_ADVANCES:
            left = ti.max(vector.dot(normal) - radius, 0.0) / ti.max(-d.dot(normal), LEAST_APPROACH)
            distance, is_open = ti.select(count == 0 and depth < 0.0, depth, at + left), 0
        else:
            at += gap / approach
            if at >= best:
                is_open = 0
        count += 1
    if normal.dot(face) < BACK_SIDE * face.norm():
        distance = NO_HIT
    return ti.Vector([distance, normal.x, normal.y, normal.z, place.x, place.y, place.z])
