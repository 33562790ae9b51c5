# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Kernels for screen-space ambient occlusion, at half the image's width and height.

On a plane in space, q = 1 / depth is linear in the image: q = a u + b v + c. Therefore the height of a point
above the plane of a triangle follows from (u, v) and q of the point.
"""

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.runtime import ti
from taichi_soft.render.backdrop_kernels import pixel_ray
from taichi_soft.render.kernel_types import TILE, ints, reals, rows, vec3

HALF = TILE // 2
"""Number of occlusion points along the edge of a tile."""

TAPS = 10
"""Number of depth samples around a point."""

TURNS = 4
"""Edge of a block [points]. The taps are rotated by a different angle at each point of a block, and the
results are averaged over the block."""

WIDEST = 64.0
"""Largest distance between a point and its depth samples [points]."""

BIAS = 0.12
"""Sine of the smallest angle above a triangle's plane at which other surfaces occlude the triangle. Without
this limit, the flat triangles of a curved surface would occlude each other."""

STRENGTH = 10.0
"""Factor in exp(-STRENGTH * occlusion), the fraction of the surroundings that stays visible."""

ALIKE = 0.03
"""Relative difference of depth above which two points belong to different surfaces."""


def spiral_taps() -> NDArray[np.float32]:
    """Return offsets of the taps within the unit circle, float32 (TURNS * TURNS * TAPS, 2).

    The `TAPS` offsets of each point of a block are contiguous. They form a spiral that is densest at its
    centre.
    """
    k = np.arange(TAPS)
    turn = np.arange(TURNS * TURNS)[:, None] * 7 % (TURNS * TURNS)
    angle = 2.0 * np.pi * turn / (TURNS * TURNS) + 2.3999632 * k  # in steps of the golden angle
    radius = (k + 0.6) / TAPS
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    return places.reshape(-1, 2).astype(np.float32)


@ti.kernel
def gather_depth(
    width: ti.i32,
    samples: ti.i32,
    backdrop: vec3,
    offset_u: ti.f32,
    offset_v: ti.f32,
    tile_begin: ints,
    depth: reals,
    out: rows,
):
    """Store q = 1 / depth of the first sample of every second pixel.

    In tiles without triangles, store q of the floor.

    Args:
        backdrop: coefficients a, b, c of q = a u + b v + c on the floor.
        offset_u, offset_v: position of the first sample relative to the centre of the pixel [pixels].
        out: (height / 2, width / 2).
    """
    tiles_across = (width + TILE - 1) // TILE
    for tile in range(tile_begin.shape[0] - 1):
        left, top = tile % tiles_across * HALF, tile // tiles_across * HALF
        is_empty = tile_begin[tile + 1] == tile_begin[tile]
        for j in range(top, ti.min(top + HALF, out.shape[0])):
            for i in range(left, ti.min(left + HALF, out.shape[1])):
                if is_empty:
                    u, v = 2.0 * i + 0.5 + offset_u, 2.0 * j + 0.5 + offset_v
                    out[j, i] = backdrop.x * u + backdrop.y * v + backdrop.z
                else:
                    out[j, i] = depth[(2 * j * width + 2 * i) * samples]


@ti.func
def hidden_share(
    q_map: ti.template(),
    rays: ti.template(),
    lens: ti.template(),
    plane,
    i,
    j,
    offset_u,
    offset_v,
    reach,
    focal,
    taps: ti.template(),
):
    """Return the occluded fraction of the surroundings of point (i, j) on a triangle.

    Args:
        rays: matrix (3, 3) from (u, v, 1) to the direction through a pixel.
        lens: inverse of `rays`.
        plane: coefficients a, b, c of q = 1 / depth = a u + b v + c on the triangle.
        reach: distance beyond which nothing occludes [m].
        focal: focal length [pixels].
    """
    u, v = 2.0 * i + 0.5 + offset_u, 2.0 * j + 0.5 + offset_v
    q = plane.dot(ti.Vector([u, v, 1.0]))
    here = pixel_ray(rays, u, v) / q  # position relative to the eye [m]
    # Normal n of the triangle in space, with n . here = 1.
    normal = ti.Vector(
        [lens[0, k] * plane.x + lens[1, k] * plane.y + lens[2, k] * plane.z for k in ti.static(range(3))]
    )
    scale = 1.0 / ti.sqrt(ti.max(normal.dot(normal), 1e-30))
    wide = ti.min(0.5 * focal * reach * q, WIDEST)
    first = (i % TURNS + TURNS * (j % TURNS)) * TAPS
    total = 0.0
    for k in range(TAPS):
        x = ti.math.clamp(ti.i32(i + 0.5 + wide * taps[first + k, 0]), 0, q_map.shape[1] - 1)
        y = ti.math.clamp(ti.i32(j + 0.5 + wide * taps[first + k, 1]), 0, q_map.shape[0] - 1)
        q_there = q_map[y, x]
        if q_there > 0.0:
            u_there, v_there = 2.0 * x + 0.5 + offset_u, 2.0 * y + 0.5 + offset_v
            above = scale * (1.0 - plane.dot(ti.Vector([u_there, v_there, 1.0])) / q_there)
            if above > 0.0:
                offset = pixel_ray(rays, u_there, v_there) / q_there - here
                far2 = offset.dot(offset)
                near = ti.max(1.0 - far2 / (reach * reach), 0.0)
                # Adding a thousandth of the reach to the distance prevents round-off from causing
                # self-occlusion.
                total += ti.max(above / ti.sqrt(far2 + 1e-6 * reach * reach) - BIAS, 0.0) * near
    return 1.0 - ti.exp(-STRENGTH * total / TAPS)


@ti.kernel
def find_hidden(
    width: ti.i32,
    samples: ti.i32,
    rays: rows,
    lens: rows,
    focal: ti.f32,
    offset_u: ti.f32,
    offset_v: ti.f32,
    reach: ti.f32,
    tile_begin: ints,
    owner: ints,
    planes: rows,
    taps: rows,
    q_map: rows,
    out: rows,
):
    """Compute `hidden_share` of every second pixel that shows a body, in tiles with triangles.

    Args:
        focal: focal length [pixels].
        taps: see `spiral_taps`.
        q_map: result of `gather_depth`.
        out: (height / 2, width / 2); 0 at points without a body.
    """
    tiles_across = (width + TILE - 1) // TILE
    for tile in range(tile_begin.shape[0] - 1):
        left, top = tile % tiles_across * HALF, tile // tiles_across * HALF
        if tile_begin[tile + 1] > tile_begin[tile]:
            for j in range(top, ti.min(top + HALF, out.shape[0])):
                for i in range(left, ti.min(left + HALF, out.shape[1])):
                    t = owner[(2 * j * width + 2 * i) * samples]
                    hidden = 0.0
                    if t >= 0:
                        plane = ti.Vector([planes[t, 9], planes[t, 10], planes[t, 11]])
                        hidden = hidden_share(
                            q_map, rays, lens, plane, i, j, offset_u, offset_v, reach, focal, taps
                        )
                    out[j, i] = ti.select(hidden > 0.0, hidden, 0.0)  # NaN becomes 0


@ti.kernel
def spread_hidden(width: ti.i32, tile_begin: ints, q_map: rows, hidden: rows, out: rows):
    """Average blocks of `TURNS` by `TURNS` points of similar depth, in tiles with triangles."""
    tiles_across = (width + TILE - 1) // TILE
    for tile in range(tile_begin.shape[0] - 1):
        left, top = tile % tiles_across * HALF, tile // tiles_across * HALF
        if tile_begin[tile + 1] > tile_begin[tile]:
            for j in range(top, ti.min(top + HALF, out.shape[0])):
                for i in range(left, ti.min(left + HALF, out.shape[1])):
                    q = q_map[j, i]
                    total, count = 0.0, 0.0
                    for dj in range(TURNS):
                        y = j + dj - 1
                        if y >= 0 and y < out.shape[0]:
                            for di in range(TURNS):
                                x = i + di - 1
                                if x >= 0 and x < out.shape[1]:
                                    if ti.abs(q_map[y, x] - q) < ALIKE * ti.abs(q):
                                        total += hidden[y, x]
                                        count += 1.0
                    out[j, i] = total / ti.max(count, 1.0)


@ti.func
def openness_at(q_map: ti.template(), hidden: ti.template(), x, y, q):
    """Interpolate the unoccluded fraction of the surroundings at pixel (x, y), 0 to 1, from half resolution.

    Args:
        q: 1 / depth of the surface at the pixel.
    """
    i, j = x // 2, y // 2
    total, weights = 0.0, 1e-6
    for dj in range(y % 2 + 1):
        for di in range(x % 2 + 1):
            row, column = ti.min(j + dj, q_map.shape[0] - 1), ti.min(i + di, q_map.shape[1] - 1)
            weight = 1.0 / (1e-4 + ti.abs(q_map[row, column] / q - 1.0))
            total += weight * hidden[row, column]
            weights += weight
    return 1.0 - total / weights
