"""Vertices and normals of one body, as a renderer draws them."""

from taichi_soft.core.runtime import ti

NO_LENGTH = 1e-37
"""Square [m^4] of the sum of a vertex's triangles below which they have no direction: float32 ends there."""

CHUNK = 256
"""Rows that one thread writes in one go. How a row is rounded may depend on where in such a loop it comes, so
that is the same for any number of threads."""


@ti.func
def chunk_count(rows):
    return (rows + CHUNK - 1) // CHUNK


@ti.func
def _row(rows: ti.template(), i):
    return ti.Vector([rows[3 * i], rows[3 * i + 1], rows[3 * i + 2]])


@ti.kernel
def write_render_mesh(
    state: ti.template(),
    is_serial: ti.template(),
    body: ti.i32,
    alpha: ti.f32,
    table: ti.types.ndarray(dtype=ti.i32, ndim=1),
    areas: ti.types.ndarray(dtype=ti.f32, ndim=1),
    positions: ti.types.ndarray(dtype=ti.f32, ndim=1),
    normals: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Positions [m] and unit normals of k render vertices, `alpha` of the way from the previous step (0) to
    the last one (1).

    Each loop writes rows of its own and reads what the one before has written: no order of threads matters.
    Args:
        table: of `RenderMesh`: vertices of the body (k,), render vertices of the triangles (3 m,), where the
            triangles of each render vertex begin in this table (k + 1,), and these.
        areas: (3 m,) for the triangles' normals, as long as twice their area [m^2].
        positions, normals: (3 k,).
    """
    ti.loop_config(serialize=is_serial)
    for chunk in range(chunk_count(positions.shape[0] // 3)):
        first = state.body_particles[body][0]
        for i in range(CHUNK * chunk, ti.min(CHUNK * (chunk + 1), positions.shape[0] // 3)):
            p = state.particle_of_vertex[first + table[i]]
            before, after = state.prev_position[p], state.particle_position[p]
            x = before + alpha * (after - before)
            if alpha == 1.0:
                x = after
            for k in ti.static(range(3)):
                positions[3 * i + k] = x[k]
    ti.loop_config(serialize=is_serial)
    for chunk in range(chunk_count(areas.shape[0] // 3)):
        for t in range(CHUNK * chunk, ti.min(CHUNK * (chunk + 1), areas.shape[0] // 3)):
            corner = positions.shape[0] // 3 + 3 * t
            a = _row(positions, table[corner])
            n = (_row(positions, table[corner + 1]) - a).cross(_row(positions, table[corner + 2]) - a)
            for k in ti.static(range(3)):
                areas[3 * t + k] = n[k]
    ti.loop_config(serialize=is_serial)
    for chunk in range(chunk_count(positions.shape[0] // 3)):
        for i in range(CHUNK * chunk, ti.min(CHUNK * (chunk + 1), positions.shape[0] // 3)):
            begin = positions.shape[0] // 3 + areas.shape[0] + i
            n = ti.Vector.zero(ti.f32, 3)
            for row in range(table[begin], table[begin + 1]):
                n += _row(areas, table[row])
            square = n.dot(n)
            n *= ti.rsqrt(ti.max(square, NO_LENGTH))
            if square <= NO_LENGTH:
                n = ti.Vector([0.0, 0.0, 1.0])
            for k in ti.static(range(3)):
                normals[3 * i + k] = n[k]
