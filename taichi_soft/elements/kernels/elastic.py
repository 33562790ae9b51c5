"""Elastic forces of tetrahedra: load values, call the law, store corner forces.

The lanes of a block run in one loop that reads fields and writes only local arrays. LLVM's loop vectoriser
then turns the eight lanes into one pass over vector registers (see `taichi-soft profile --baseline`). The
vectoriser has two requirements. The loop must not write to a field, because the next lane could read the same
memory. Index arithmetic must provably not overflow; the mask `BLOCK_BITS` ensures this.
"""

from taichi_soft.core.constants import LANES
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import DampingModel
from taichi_soft.elements.laws.damping import tet_mean_damping_forces
from taichi_soft.elements.laws.force_model import flipped_forces, upright_forces

BLOCK_BITS = (1 << 22) - 1
"""Mask that leaves every block number unchanged. A larger block number would need 33 million tetrahedra, more
than memory can hold."""


@ti.func
def particles_of(state: ti.template(), block, lane):
    base = block * 4 * LANES + lane
    return (
        state.tet_vertices[base],
        state.tet_vertices[base + LANES],
        state.tet_vertices[base + 2 * LANES],
        state.tet_vertices[base + 3 * LANES],
    )


@ti.func
def rest_inverse_of(state: ti.template(), block, lane):
    base = block * 9 * LANES + lane
    a = [state.tet_rest_inverse[base + k * LANES] for k in ti.static(range(9))]
    return ti.Vector([a[0], a[1], a[2]]), ti.Vector([a[3], a[4], a[5]]), ti.Vector([a[6], a[7], a[8]])


@ti.func
def stiffness_of(state: ti.template(), block, lane):
    """Stiffness of an anisotropic tetrahedron [Pa], in the form that `anisotropic_stress` needs."""
    base = block * 21 * LANES + lane
    c = [state.tet_stiffness[base + k * LANES] for k in ti.static(range(21))]
    return (
        (ti.Vector([c[0], c[1], c[2]]), ti.Vector([c[1], c[6], c[7]]), ti.Vector([c[2], c[7], c[11]])),
        (ti.Vector([c[3], c[8], c[12]]), ti.Vector([c[4], c[9], c[13]]), ti.Vector([c[5], c[10], c[14]])),
        (
            ti.Vector([c[15], c[16], c[17]]),
            ti.Vector([c[16], c[18], c[19]]),
            ti.Vector([c[17], c[19], c[20]]),
        ),
    )


@ti.func
def elasticity_of(state: ti.template(), model: ti.template(), block, lane):
    """Elasticity of a tetrahedron [Pa]: lambda and mu, or `stiffness_of` for an anisotropic material."""
    if ti.static(model.is_anisotropic):
        return stiffness_of(state, block, lane)
    else:
        return state.tet_lame[block * 2 * LANES + lane], state.tet_lame[(block * 2 + 1) * LANES + lane]


@ti.func
def _upright_forces_of(state: ti.template(), model: ti.template(), block, lane):
    p0, p1, p2, p3 = particles_of(state, block, lane)
    x0, x1 = state.particle_position[p0], state.particle_position[p1]
    x2, x3 = state.particle_position[p2], state.particle_position[p3]
    inverse = rest_inverse_of(state, block, lane)
    elasticity = elasticity_of(state, model, block, lane)
    f0, f1, f2, f3, volume6 = upright_forces(model, x0, x1, x2, x3, inverse, elasticity)
    if ti.static(model.damping_model == DampingModel.TET_MEAN):
        d0, d1, d2, d3 = tet_mean_damping_forces(
            state.particle_velocity[p0],
            state.particle_velocity[p1],
            state.particle_velocity[p2],
            state.particle_velocity[p3],
            state.tet_damping[block * LANES + lane],
        )
        f0, f1, f2, f3 = f0 + d0, f1 + d1, f2 + d2, f3 + d3
    return f0, f1, f2, f3, volume6


@ti.func
def _flipped_forces_of(state: ti.template(), model: ti.template(), block, lane):
    p0, p1, p2, p3 = particles_of(state, block, lane)
    return flipped_forces(
        model,
        state.particle_position[p0],
        state.particle_position[p1],
        state.particle_position[p2],
        state.particle_position[p3],
        rest_inverse_of(state, block, lane),
        elasticity_of(state, model, block, lane),
    )


@ti.func
def lane_forces(state: ti.template(), model: ti.template(), block, lane):
    """Forces of one tetrahedron on its corners [N]. The tetrahedron can be flipped."""
    f0, f1, f2, f3, volume6 = _upright_forces_of(state, model, block, lane)
    if ti.static(model.repairs_flips):
        if volume6 < 0.0:
            f0, f1, f2, f3 = _flipped_forces_of(state, model, block, lane)
    return f0, f1, f2, f3


@ti.func
def _compute_block_forces(
    state: ti.template(),
    model: ti.template(),
    block,
    g0: ti.template(),
    g1: ti.template(),
    g2: ti.template(),
    g3: ti.template(),
):
    """Write the forces of a block's tetrahedra on their corners [N] to four matrices (LANES, 4).

    The last column is zero. The matrices are arguments because Taichi would copy returned matrices.
    """
    volumes = ti.Vector.zero(state.real, LANES)
    for lane in range(LANES):
        f0, f1, f2, f3, volume6 = _upright_forces_of(state, model, block, lane)
        for i in ti.static(range(3)):
            g0[lane, i] = f0[i]
            g1[lane, i] = f1[i]
            g2[lane, i] = f2[i]
            g3[lane, i] = f3[i]
        # Write the zeros too, because gaps in the rows would prevent vector stores.
        g0[lane, 3] = 0.0
        g1[lane, 3] = 0.0
        g2[lane, 3] = 0.0
        g3[lane, 3] = 0.0
        if ti.static(model.repairs_flips):
            volumes[lane] = volume6
    if ti.static(model.repairs_flips):
        # Flips are rare, so a separate loop corrects them and the loop above stays fast.
        for lane in range(LANES):
            if volumes[lane] < 0.0:
                f0, f1, f2, f3 = _flipped_forces_of(state, model, block, lane)
                for i in ti.static(range(3)):
                    g0[lane, i] = f0[i]
                    g1[lane, i] = f1[i]
                    g2[lane, i] = f2[i]
                    g3[lane, i] = f3[i]


@ti.func
def accumulate_elastic_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of all tetrahedra of one body to its particles, block by block, in one thread."""
    blocks = state.body_blocks[body]
    for number in range(blocks[0], blocks[1]):
        block = number & BLOCK_BITS
        g0 = ti.Matrix.zero(state.real, LANES, 4)
        g1 = ti.Matrix.zero(state.real, LANES, 4)
        g2 = ti.Matrix.zero(state.real, LANES, 4)
        g3 = ti.Matrix.zero(state.real, LANES, 4)
        _compute_block_forces(state, model, block, g0, g1, g2, g3)
        for lane in range(LANES):
            for corner in ti.static(range(4)):
                p = state.tet_vertices[(block * 4 + corner) * LANES + lane]
                # Do not store the selected matrix in a variable: Taichi would copy the matrix for every lane.
                force = ti.Vector([(g0, g1, g2, g3)[corner][lane, i] for i in ti.static(range(4))])
                # No `+=`: Taichi would make it atomic, although only one thread owns the body.
                state.particle_force[p] = state.particle_force[p] + force


@ti.func
def store_block_forces(state: ti.template(), model: ti.template(), number):
    """Store the corner forces of a block's tetrahedra. The particles gather these forces later."""
    block = number & BLOCK_BITS
    g0 = ti.Matrix.zero(state.real, LANES, 4)
    g1 = ti.Matrix.zero(state.real, LANES, 4)
    g2 = ti.Matrix.zero(state.real, LANES, 4)
    g3 = ti.Matrix.zero(state.real, LANES, 4)
    _compute_block_forces(state, model, block, g0, g1, g2, g3)
    for corner in ti.static(range(4)):
        for lane in range(LANES):
            force = ti.Vector([(g0, g1, g2, g3)[corner][lane, i] for i in ti.static(range(4))])
            state.corner_force[(block * 4 + corner) * LANES + lane] = force


@ti.func
def store_lane_forces(state: ti.template(), model: ti.template(), block, lane):
    """Store the corner forces of one tetrahedron, for processors that run one tetrahedron per thread."""
    forces = lane_forces(state, model, block, lane)
    for corner in ti.static(range(4)):
        state.corner_force[(block * 4 + corner) * LANES + lane] = widened(forces[corner])
