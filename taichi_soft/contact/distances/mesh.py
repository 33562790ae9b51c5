"""A solid given by its signed distance on a grid, which is all that is left of its mesh."""

from taichi_soft.contact.distances.direction import length_and_direction
from taichi_soft.core.runtime import ti

MARGIN = 2
"""Cells between the box of the mesh and the border of its grid, at least."""

FLATTEST = 1e-3
"""Slope of the distance below which it has no direction: at the middle of a solid."""


@ti.func
def _interpolated(samples: ti.template(), resolution, offset, u):
    """Trilinear value and its gradient per cell at u, in cells from the first node."""
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
    """Signed distance [m] and normal, to a fraction of a cell.

    Interpolated distances are a little too long near edges and corners, but so is the way to the surface that
    they describe: a step by the distance ends at most a tenth of a cell inside.
    Outside the grid the way to it and the distance from there are two sides of a triangle with no sharp angle
    between them; and the solid's box lies `MARGIN` cells within.
    Parameters: first node of the grid (3), cell [m].
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
