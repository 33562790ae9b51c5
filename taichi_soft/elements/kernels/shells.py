"""Forces of shells: load values, call the law, store the forces on six points.

The lanes of a block run in one loop that reads fields and writes only local arrays, as in `elastic`.
"""

from taichi_soft.core.constants import LANES
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.elastic import BLOCK_BITS
from taichi_soft.elements.laws.shell import POINTS, shell_forces


@ti.func
def shell_forces_of(state: ti.template(), block, lane):
    """Forces of one shell element on its points 1 to 5 [N], see `shell_forces`."""
    row = block * POINTS * LANES + lane
    p = [state.shell_points[row + k * LANES] for k in ti.static(range(POINTS))]
    x0, v0 = state.particle_position[p[0]], state.particle_velocity[p[0]]
    d = [state.particle_position[p[k]] - x0 for k in ti.static(range(1, POINTS))]
    w = [state.particle_velocity[p[k]] - v0 for k in ti.static(range(1, POINTS))]
    inverse = [state.shell_rest_inverse[(block * 3 + k) * LANES + lane] for k in ti.static(range(3))]
    lame = [state.shell_lame[(block * 2 + k) * LANES + lane] for k in ti.static(range(2))]
    bending = [state.shell_bending[(block * 18 + k) * LANES + lane] for k in ti.static(range(18))]
    return shell_forces(d, w, inverse, lame, bending, state.shell_bending_damping[block * LANES + lane])


@ti.func
def accumulate_shell_forces(state: ti.template(), body):
    """Add the forces of all shell elements of one body to its particles, block by block, in one thread."""
    blocks = state.body_shells[body]
    for number in range(blocks[0], blocks[1]):
        block = number & BLOCK_BITS
        g1 = ti.Matrix.zero(state.real, LANES, 4)
        g2 = ti.Matrix.zero(state.real, LANES, 4)
        g3 = ti.Matrix.zero(state.real, LANES, 4)
        g4 = ti.Matrix.zero(state.real, LANES, 4)
        g5 = ti.Matrix.zero(state.real, LANES, 4)
        for lane in range(LANES):
            f = shell_forces_of(state, block, lane)
            for i in ti.static(range(3)):
                g1[lane, i] = f[0][i]
                g2[lane, i] = f[1][i]
                g3[lane, i] = f[2][i]
                g4[lane, i] = f[3][i]
                g5[lane, i] = f[4][i]
            # Write the zeros too, because gaps in the rows would prevent vector stores.
            g1[lane, 3] = 0.0
            g2[lane, 3] = 0.0
            g3[lane, 3] = 0.0
            g4[lane, 3] = 0.0
            g5[lane, 3] = 0.0
        for lane in range(LANES):
            total = ti.Vector.zero(state.real, 4)
            for k in ti.static(range(5)):
                p = state.shell_points[(block * POINTS + k + 1) * LANES + lane]
                # Do not store the selected matrix in a variable: Taichi would copy the matrix for every lane.
                force = ti.Vector([(g1, g2, g3, g4, g5)[k][lane, i] for i in ti.static(range(4))])
                total += force
                # No `+=`: Taichi would make it atomic, although only one thread owns the body.
                state.particle_force[p] = state.particle_force[p] + force
            p = state.shell_points[block * POINTS * LANES + lane]
            state.particle_force[p] = state.particle_force[p] - total
