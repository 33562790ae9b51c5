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
