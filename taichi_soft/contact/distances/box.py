"""Signed distance from a box centred on the origin, with edges along the axes."""

from taichi_soft.contact.distances.direction import length_and_direction
from taichi_soft.core.runtime import ti


@ti.func
def box_distance(parameters, x):
    """Return signed distance [m] and normal. Inside the box, the normal is that of the nearest face.

    Parameters: half of each edge length (3) [m].
    """
    side = ti.Vector([0.0, 0.0, 0.0])
    for i in ti.static(range(3)):
        side[i] = ti.select(x[i] < 0.0, -1.0, 1.0)
    beyond = ti.abs(x) - ti.Vector([parameters[0], parameters[1], parameters[2]])
    face = ti.Vector([0.0, 0.0, side[2]])
    if beyond[0] >= ti.max(beyond[1], beyond[2]):
        face = ti.Vector([side[0], 0.0, 0.0])
    elif beyond[1] >= beyond[2]:
        face = ti.Vector([0.0, side[1], 0.0])
    outside, normal = length_and_direction(side * ti.max(beyond, 0.0), face)
    return outside + ti.min(beyond.max(), 0.0), normal


@ti.func
def is_over_one_side(parameters, x, y, z, margin):
    """Return 1 if one side of a box is nearest to all points of a triangle, else 0.

    The distance then changes linearly across the triangle, so that a corner is nearest.

    Args: margin: distance that the corners `x`, `y`, `z` can move [m].
    """
    found = 0
    for axis in ti.static(range(3)):
        for side in ti.static((-1.0, 1.0)):
            least = ti.cast(1e30, ti.f32)
            for corner in ti.static((x, y, z)):
                above = side * corner[axis] - parameters[axis]
                for other in ti.static(((axis + 1) % 3, (axis + 2) % 3)):
                    inside = parameters[other] - ti.abs(corner[other])
                    least = ti.min(least, inside, above + inside)
            found = found | int(least > 2.0 * margin)
    return found


@ti.func
def span_over_side(parameters, thickness, x, y, gradient):
    """Return the part of a line over the side of a box to which the `gradient` of the distance points.

    Returns: fractions of the line from `x` to `y` at both ends of the part, 0 to 1; heights of these ends
    over the skin of the side [m]; normal of the side.
    """
    normal, first, last = ti.Vector.zero(ti.f32, 3), ti.cast(0.0, ti.f32), ti.cast(1.0, ti.f32)
    steep, above, climb = ti.abs(gradient).max(), ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32)
    found = 0
    for i in ti.static(range(3)):
        along = y[i] - x[i]
        if found == 0 and ti.abs(gradient[i]) == steep:
            found = 1
            normal[i] = ti.select(gradient[i] < 0.0, -1.0, 1.0)
            above, climb = normal[i] * x[i] - parameters[i] - thickness, normal[i] * along
        elif ti.abs(along) > 1e-12:
            low, high = (-parameters[i] - x[i]) / along, (parameters[i] - x[i]) / along
            first, last = ti.max(first, ti.min(low, high)), ti.min(last, ti.max(low, high))
    return first, last, above + first * climb, above + last * climb, normal
