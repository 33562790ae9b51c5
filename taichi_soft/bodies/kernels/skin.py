"""Vertices and normals of an artist's mesh that is bound to a body."""

import numpy as np

from taichi_soft.bodies.kernels.origins import has_view
from taichi_soft.bodies.kernels.render_mesh import drawn_position
from taichi_soft.core.runtime import ti

FRAME = 12
"""Number of values stored for each vertex of the body: the columns of the deformation gradient F, and the
vector x - F X / 2, where x is the position and X the rest position."""

ROW = 10
"""Number of values per skin vertex: four weights, the position q (see `bodies.skin`), the normal at rest."""

LANES = 16
"""Number of skin vertices that are stored and computed together."""

NO_LENGTH = 1e-30
"""Squared norm below which a normal counts as zero. It is near the smallest number of float32."""


def interleaved(rows: np.ndarray) -> np.ndarray:
    """Return rows (k, n) in kernel order, as a flat array with `LANES` n numbers for each block of rows.

    A block contains the first numbers of `LANES` rows, then their second numbers, and so on. The last block
    is padded with 0.
    """
    blocks = -(-len(rows) // LANES)
    padded = np.zeros((blocks * LANES, rows.shape[1]), dtype=rows.dtype)
    padded[: len(rows)] = rows
    return padded.reshape(blocks, LANES, -1).swapaxes(1, 2).ravel()


@ti.func
def _three(numbers: ti.template(), at):
    return ti.Vector([numbers[at], numbers[at + 1], numbers[at + 2]])


@ti.kernel
def write_skin(
    state: ti.template(),
    is_serial: ti.template(),
    body: ti.i32,
    count: ti.i32,
    alpha: ti.f32,
    ints: ti.types.ndarray(dtype=ti.i32, ndim=1),
    floats: ti.types.ndarray(dtype=ti.f32, ndim=1),
    frames: ti.types.ndarray(dtype=ti.f32, ndim=1),
    positions: ti.types.ndarray(dtype=ti.f32, ndim=1),
    normals: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Write positions [m] and unit normals of skin vertices.

    Positions and normals are interpolated by `alpha` from the previous step (0) to the last step (1).

    Args:
        count: number of vertices of the body.
        ints: index of the first neighbour of each of these vertices, and the number of neighbours; the
            neighbours; the four vertices of the body that carry each skin vertex, `interleaved`.
        floats: row of each neighbour (see `gradient_rows`); the body's vertices at rest; `ROW` numbers for
            each skin vertex, `interleaved`.
        frames: work array, (FRAME count,).
        positions, normals: (3 k,).
    """
    ti.loop_config(serialize=is_serial)
    for vertex in range(count):
        first = state.body_particles[body][0]
        x = drawn_position(state, first, vertex, alpha, has_view(state))
        F = ti.Matrix.zero(ti.f32, 3, 3)
        for e in range(ints[vertex], ints[vertex + 1]):
            edge = drawn_position(state, first, ints[count + 1 + e], alpha, has_view(state)) - x
            F += edge.outer_product(_three(floats, 3 * e))
        offset = x - 0.5 * (F @ _three(floats, 3 * (ints[count] + vertex)))
        for i in ti.static(range(3)):
            frames[FRAME * vertex + 9 + i] = offset[i]
            for j in ti.static(range(3)):
                frames[FRAME * vertex + 3 * j + i] = F[i, j]
    edges, size = ints[count], positions.shape[0] // 3
    ti.loop_config(serialize=is_serial)
    for block in range((size + LANES - 1) // LANES):
        rows = 3 * (edges + count) + ROW * LANES * block
        corners = count + 1 + edges + 4 * LANES * block
        drawn = ti.Vector.zero(ti.f32, 6 * LANES)
        for lane in range(LANES):  # LLVM vectorises this loop, because it writes only to local arrays
            frame = ti.Vector.zero(ti.f32, FRAME)
            for c in ti.static(range(4)):
                start, weight = FRAME * ints[corners + LANES * c + lane], floats[rows + LANES * c + lane]
                for i in ti.static(range(FRAME)):
                    frame[i] += weight * frames[start + i]
            a, b, c, offset = (
                ti.Vector([frame[0], frame[1], frame[2]]),
                ti.Vector([frame[3], frame[4], frame[5]]),
                ti.Vector([frame[6], frame[7], frame[8]]),
                ti.Vector([frame[9], frame[10], frame[11]]),
            )
            at = rows + 4 * LANES + lane
            x = offset + 0.5 * (floats[at] * a + floats[at + LANES] * b)
            x += 0.5 * floats[at + 2 * LANES] * c
            n = floats[at + 3 * LANES] * b.cross(c) + floats[at + 4 * LANES] * c.cross(a)
            n += floats[at + 5 * LANES] * a.cross(b)
            square = n.dot(n)
            scale = 1.0 / ti.sqrt(ti.max(square, NO_LENGTH))
            has_length = square > NO_LENGTH
            for k in ti.static(range(3)):
                drawn[LANES * k + lane] = x[k]
                drawn[LANES * (3 + k) + lane] = ti.select(has_length, scale * n[k], 1.0 if k == 2 else 0.0)
        for lane in range(ti.min(LANES, size - LANES * block)):
            v = LANES * block + lane
            for k in ti.static(range(3)):
                positions[3 * v + k] = drawn[LANES * k + lane]
                normals[3 * v + k] = drawn[LANES * (3 + k) + lane]
