"""Elastic forces of tetrahedra: loads values, calls the law, stores corner forces.

A block of `LANES` tetrahedra first computes all its lanes and only then stores them, coordinate by
coordinate: stores between the lanes would keep the compiler from running the lanes in vector registers.
"""

from taichi_soft.constants import LANES
from taichi_soft.laws.damping import tet_mean_damping_forces
from taichi_soft.laws.model import flipped_forces, upright_forces
from taichi_soft.runtime import ti
from taichi_soft.state import CORNER_ROWS
from taichi_soft.types import DampingModel


@ti.func
def _particles_of(state: ti.template(), block, lane):
    base = block * 4 * LANES + lane
    return (
        state.tet_vertices[base],
        state.tet_vertices[base + LANES],
        state.tet_vertices[base + 2 * LANES],
        state.tet_vertices[base + 3 * LANES],
    )


@ti.func
def _rest_inverse_of(state: ti.template(), block, lane):
    base = block * 9 * LANES + lane
    a = [state.tet_rest_inverse[base + k * LANES] for k in ti.static(range(9))]
    return ti.Vector([a[0], a[1], a[2]]), ti.Vector([a[3], a[4], a[5]]), ti.Vector([a[6], a[7], a[8]])


@ti.func
def tet_forces(state: ti.template(), model: ti.template(), block, lane):
    """Forces of one tetrahedron on its corners [N], and six times its signed volume."""
    p0, p1, p2, p3 = _particles_of(state, block, lane)
    x0, x1 = state.particle_position[p0], state.particle_position[p1]
    x2, x3 = state.particle_position[p2], state.particle_position[p3]
    inverse = _rest_inverse_of(state, block, lane)
    lame_lambda = state.tet_lame[block * 2 * LANES + lane]
    lame_mu = state.tet_lame[(block * 2 + 1) * LANES + lane]
    f0, f1, f2, f3, volume6 = upright_forces(model, x0, x1, x2, x3, inverse, lame_lambda, lame_mu)
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
def _store_corners(state: ti.template(), place, lane, f0, f1, f2, f3, volume6):
    for i in ti.static(range(3)):
        state.corner_force[place + i * LANES + lane] = f0[i]
        state.corner_force[place + (3 + i) * LANES + lane] = f1[i]
        state.corner_force[place + (6 + i) * LANES + lane] = f2[i]
        state.corner_force[place + (9 + i) * LANES + lane] = f3[i]
    state.corner_force[place + 12 * LANES + lane] = volume6


@ti.func
def _repair_flip(state: ti.template(), model: ti.template(), block, lane, place):
    """Replace the forces of a tetrahedron that turned out to be flipped. Rare, so off the vector path."""
    if state.corner_force[place + 12 * LANES + lane] < 0.0:
        p0, p1, p2, p3 = _particles_of(state, block, lane)
        f0, f1, f2, f3 = flipped_forces(
            model,
            state.particle_position[p0],
            state.particle_position[p1],
            state.particle_position[p2],
            state.particle_position[p3],
            _rest_inverse_of(state, block, lane),
            state.tet_lame[block * 2 * LANES + lane],
            state.tet_lame[(block * 2 + 1) * LANES + lane],
        )
        _store_corners(state, place, lane, f0, f1, f2, f3, -1.0)


@ti.func
def compute_block_forces(state: ti.template(), model: ti.template(), block, place):
    """Corner forces of the block's tetrahedra, written to `corner_force` from index `place` on."""
    if ti.static(model.is_branch_free):
        g0 = ti.Matrix.zero(ti.f32, 3, LANES)
        g1 = ti.Matrix.zero(ti.f32, 3, LANES)
        g2 = ti.Matrix.zero(ti.f32, 3, LANES)
        g3 = ti.Matrix.zero(ti.f32, 3, LANES)
        volumes = ti.Vector.zero(ti.f32, LANES)
        for lane in ti.static(range(LANES)):
            f0, f1, f2, f3, volume6 = tet_forces(state, model, block, lane)
            for i in ti.static(range(3)):
                g0[i, lane], g1[i, lane], g2[i, lane], g3[i, lane] = f0[i], f1[i], f2[i], f3[i]
            volumes[lane] = volume6
        for i in ti.static(range(3)):
            for lane in ti.static(range(LANES)):
                state.corner_force[place + i * LANES + lane] = g0[i, lane]
                state.corner_force[place + (3 + i) * LANES + lane] = g1[i, lane]
                state.corner_force[place + (6 + i) * LANES + lane] = g2[i, lane]
                state.corner_force[place + (9 + i) * LANES + lane] = g3[i, lane]
        if ti.static(model.repairs_flips):
            for lane in ti.static(range(LANES)):
                state.corner_force[place + 12 * LANES + lane] = volumes[lane]
    else:
        for lane in range(LANES):
            f0, f1, f2, f3, volume6 = tet_forces(state, model, block, lane)
            _store_corners(state, place, lane, f0, f1, f2, f3, volume6)
    if ti.static(model.repairs_flips):
        for lane in range(LANES):
            _repair_flip(state, model, block, lane, place)


@ti.func
def compute_lane_forces(state: ti.template(), model: ti.template(), block, lane, place):
    """As `compute_block_forces` for one lane: for processors that run one tetrahedron per thread."""
    f0, f1, f2, f3, volume6 = tet_forces(state, model, block, lane)
    _store_corners(state, place, lane, f0, f1, f2, f3, volume6)
    if ti.static(model.repairs_flips):
        _repair_flip(state, model, block, lane, place)


@ti.func
def corner_force_at(state: ti.template(), slot):
    """The force whose x component lies at index `slot`."""
    return ti.Vector(
        [state.corner_force[slot], state.corner_force[slot + LANES], state.corner_force[slot + 2 * LANES]]
    )


@ti.func
def accumulate_elastic_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of all tetrahedra of one body to its particles, block by block, in one thread."""
    blocks = state.body_blocks[body]
    place = body * CORNER_ROWS * LANES
    for block in range(blocks[0], blocks[1]):
        compute_block_forces(state, model, block, place)
        for lane in range(LANES):
            for corner in ti.static(range(4)):
                p = state.tet_vertices[(block * 4 + corner) * LANES + lane]
                force = corner_force_at(state, place + 3 * corner * LANES + lane)
                # Not `+=`, which Taichi makes atomic: one thread owns the body.
                state.particle_force[p] = state.particle_force[p] + force
