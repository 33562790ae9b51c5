"""Signed distance from a solid, interpolated on a grid. The mesh of the solid is not needed."""

from taichi_soft.contact.distances.direction import length_and_direction
from taichi_soft.core.runtime import ti

MARGIN = 2
"""Smallest distance between the bounding box of a mesh and the border of its grid, in cells."""

FLATTEST = 1e-3
"""Smallest slope of the interpolated distance at which a normal is computed. The slope is about 1 near the
surface, and can be 0 elsewhere, for example at the centre of a solid."""


@ti.func
def _interpolated(samples: ti.template(), resolution, offset, u):
    """Interpolate the samples trilinearly at `u`, in cells from the first node.

    Returns: the interpolated distance [m], and its gradient [m per cell].
    """
    base = ti.Vector([0, 0, 0])
    for axis in ti.static(range(3)):
        base[axis] = ti.max(0, ti.min(resolution[axis] - 2, int(u[axis])))
    w = u - base
    value = 0.0
    gradient = ti.Vector([0.0, 0.0, 0.0])
    for k in range(8):
        corner = ti.Vector([k // 4, k // 2 % 2, k % 2])
        at = base + corner
        sample = samples[offset + (at[0] * resolution[1] + at[1]) * resolution[2] + at[2]]
        share = corner * w + (1 - corner) * (1.0 - w)
        side = 2.0 * corner - 1.0
        value += sample * share[0] * share[1] * share[2]
        gradient += sample * ti.Vector(
            [
                side[0] * share[1] * share[2],
                share[0] * side[1] * share[2],
                share[0] * share[1] * side[2],
            ]
        )
    return value, gradient


@ti.func
def mesh_distance(samples: ti.template(), parameters, resolution, offset, x):
    """Return the signed distance [m], accurate to a fraction of a cell, and the normal.

    Interpolated distances are slightly too long near edges and corners: a step by the distance ends at most a
    tenth of a cell inside the solid. Outside the grid, the distance combines the distance to the grid with
    the interpolated distance at the grid's nearest point. The two paths meet at an angle of 90 degrees or
    more, because the solid's box lies `MARGIN` cells inside the grid.
    Parameters: position of the grid's first node (3) [m]; distance between neighbouring nodes [m].
    """
    cell = parameters[3]
    low = ti.Vector([parameters[0], parameters[1], parameters[2]])
    high = low + cell * ti.cast(resolution - 1, ti.f32)
    inside = ti.max(low, ti.min(high, x))
    distance, gradient = _interpolated(samples, resolution, offset, (inside - low) / cell)
    slope = gradient.norm()
    normal = ti.Vector([0.0, 0.0, 1.0])
    if slope > FLATTEST * cell:
        normal = gradient / slope
    beside = x - inside
    if beside.norm_sqr() > 0.0:
        normal = length_and_direction(beside + distance * normal, normal)[1]
        solid_gap = ti.max(low + MARGIN * cell - x, x - high + MARGIN * cell, 0.0)
        distance = ti.max(ti.sqrt(beside.norm_sqr() + distance * distance), solid_gap.norm())
    return distance, normal
