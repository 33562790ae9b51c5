"""Vertices and normals of one body for a renderer.

Render vertices are grouped in blocks of `LANES`. The computation of a block does not depend on its position,
so the results are bitwise identical for any number of threads.
"""

from taichi_soft.bodies.kernels.origins import has_view, seen_position
from taichi_soft.core.constants import LANES
from taichi_soft.core.runtime import ti

RING, SMALL_RING = 9, 7
"""RING is the largest number of entries of the ring around a render vertex. SMALL_RING is the largest
number in the first blocks of the table. A closed ring repeats its first vertex, so eight triangles need
nine entries. Most render vertices have six triangles, which need seven entries."""

STRIDE = (1 + RING) * LANES
"""Number of entries of a block in the table of `render_table`."""

BLOCK_BITS = (1 << 24) - 1
"""Mask that leaves block numbers unchanged. It proves to the compiler that indices cannot overflow."""

NO_LENGTH = 1e-37
"""Squared norm of a sum of triangle normals, below which the sum counts as zero [m^4]. It is near the
smallest number of float32."""


@ti.func
def _row(rows: ti.template(), i):
    return ti.Vector([rows[3 * i], rows[3 * i + 1], rows[3 * i + 2]])


@ti.func
def drawn_position(state: ti.template(), first, vertex, alpha, is_relative):
    """Return the position of a vertex [m], see `seen_position`. `first` is the body's first particle."""
    return seen_position(state, state.particle_of_vertex[first + vertex], alpha, is_relative)


@ti.func
def _block_count(positions: ti.template()):
    return (positions.shape[0] // 3 + LANES - 1) // LANES


@ti.func
def _sum_of_ring(positions: ti.template(), table: ti.template(), place, length: ti.template()):
    """Return the sum of the normals of the triangles around a render vertex [m^2].

    The length of each normal is twice the area of the triangle.
    """
    a = _row(positions, table[place])
    one = _row(positions, table[place + LANES]) - a
    n = ti.Vector.zero(ti.f32, 3)
    for slot in ti.static(range(2, length + 1)):
        other = _row(positions, table[place + slot * LANES]) - a
        n += one.cross(other)
        one = other
    return n


@ti.kernel
def write_render_mesh(
    state: ti.template(),
    is_serial: ti.template(),
    body: ti.i32,
    alpha: ti.f32,
    table: ti.types.ndarray(dtype=ti.i32, ndim=1),
    positions: ti.types.ndarray(dtype=ti.f32, ndim=1),
    normals: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Write positions [m] and unit normals of render vertices.

    Positions and normals are interpolated by `alpha` from the previous step (0) to the last step (1).

    Args:
        table: see `render_table`.
        positions, normals: (3 k,).
    """
    ti.loop_config(serialize=is_serial)
    for block in range(_block_count(positions)):
        first, is_relative = state.body_particles[body][0], has_view(state)
        for lane in range(LANES):
            i = table[block * STRIDE + lane]
            x = drawn_position(state, first, table[_block_count(positions) * STRIDE + i], alpha, is_relative)
            for k in ti.static(range(3)):
                positions[3 * i + k] = x[k]
    ti.loop_config(serialize=is_serial)
    for block in range(_block_count(positions)):
        nx, ny = ti.Vector.zero(ti.f32, LANES), ti.Vector.zero(ti.f32, LANES)
        nz = ti.Vector.zero(ti.f32, LANES)
        small = table[_block_count(positions) * (STRIDE + 1) + positions.shape[0] // 3 + 1]
        # These loops read arrays and write only to local arrays, so that LLVM vectorises them in one pass.
        if block < small:
            for lane in range(LANES):
                j = lane & (LANES - 1)
                n = _sum_of_ring(positions, table, (block & BLOCK_BITS) * STRIDE + j, SMALL_RING)
                nx[j], ny[j], nz[j] = n.x, n.y, n.z
        else:
            for lane in range(LANES):
                j = lane & (LANES - 1)
                n = _sum_of_ring(positions, table, (block & BLOCK_BITS) * STRIDE + j, RING)
                nx[j], ny[j], nz[j] = n.x, n.y, n.z
        # Add the few triangles that do not fit into the rings.
        row = _block_count(positions) * STRIDE + positions.shape[0] // 3 + block
        for number in range((table[row + 1] - table[row]) // 3):
            place = table[row] + 3 * number
            j = table[place]
            a = _row(positions, table[block * STRIDE + j])
            n = (_row(positions, table[place + 1]) - a).cross(_row(positions, table[place + 2]) - a)
            nx[j], ny[j], nz[j] = nx[j] + n.x, ny[j] + n.y, nz[j] + n.z
        for lane in range(LANES):
            j = lane & (LANES - 1)
            square = nx[j] * nx[j] + ny[j] * ny[j] + nz[j] * nz[j]
            scale = 1.0 / ti.sqrt(ti.max(square, NO_LENGTH))
            is_valid = square > NO_LENGTH
            nx[j] = ti.select(is_valid, nx[j] * scale, 0.0)
            ny[j] = ti.select(is_valid, ny[j] * scale, 0.0)
            nz[j] = ti.select(is_valid, nz[j] * scale, 1.0)
        for j in ti.static(range(LANES)):
            i = table[block * STRIDE + j]
            normals[3 * i], normals[3 * i + 1], normals[3 * i + 2] = nx[j], ny[j], nz[j]
