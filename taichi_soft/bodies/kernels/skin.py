"""Vertices and normals of an artist's mesh that a body carries."""

from taichi_soft.bodies.kernels.render_mesh import drawn_position
from taichi_soft.core.runtime import ti

FRAME = 12
"""Numbers of a frame of a vertex of the body: the gradient F of the deformation there, by columns, and where
the vertex is less F X / 2, with X its place at rest."""

ROW = 10
"""Numbers of a vertex of the skin: four shares, where it aims, its normal at rest."""

NO_LENGTH = 1e-30
"""Square of a normal below which it has no direction: float32 ends there."""


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
    """Positions [m] and unit normals, `alpha` of the way from the previous step (0) to the last one (1).

    Args:
        count: vertices of the body.
        ints: where the neighbours of each of these begin, the last end, the neighbours, and the four vertices
            of the body that each vertex of the skin hangs on.
        floats: the row of each neighbour in the gradient, the body's vertices at rest, and `ROW` numbers for
            each vertex of the skin.
        frames: to work in, (FRAME count,).
        positions, normals: (3 k,).
    """
    ti.loop_config(serialize=is_serial)
    for vertex in range(count):
        first = state.body_particles[body][0]
        x = drawn_position(state, first, vertex, alpha)
        F = ti.Matrix.zero(ti.f32, 3, 3)
        for e in range(ints[vertex], ints[vertex + 1]):
            edge = drawn_position(state, first, ints[count + 1 + e], alpha) - x
            F += edge.outer_product(_three(floats, 3 * e))
        offset = x - 0.5 * (F @ _three(floats, 3 * (ints[count] + vertex)))
        for i in ti.static(range(3)):
            frames[FRAME * vertex + 9 + i] = offset[i]
            for j in ti.static(range(3)):
                frames[FRAME * vertex + 3 * j + i] = F[i, j]
    ti.loop_config(serialize=is_serial)
    for v in range(positions.shape[0] // 3):
        edges = ints[count]
        at = 3 * (edges + count) + ROW * v
        frame = ti.Vector.zero(ti.f32, FRAME)
        for c in ti.static(range(4)):
            start, share = FRAME * ints[count + 1 + edges + 4 * v + c], floats[at + c]
            for i in range(FRAME):
                frame[i] += share * frames[start + i]
        a, b, c, offset = (
            ti.Vector([frame[0], frame[1], frame[2]]),
            ti.Vector([frame[3], frame[4], frame[5]]),
            ti.Vector([frame[6], frame[7], frame[8]]),
            ti.Vector([frame[9], frame[10], frame[11]]),
        )
        aim, normal = 0.5 * _three(floats, at + 4), _three(floats, at + 7)
        x = offset + aim.x * a + aim.y * b + aim.z * c
        n = normal.x * b.cross(c) + normal.y * c.cross(a) + normal.z * a.cross(b)
        square = n.dot(n)
        n *= ti.rsqrt(ti.max(square, NO_LENGTH))
        if square <= NO_LENGTH:
            n = ti.Vector([0.0, 0.0, 1.0])
        for k in ti.static(range(3)):
            positions[3 * v + k] = x[k]
            normals[3 * v + k] = n[k]
