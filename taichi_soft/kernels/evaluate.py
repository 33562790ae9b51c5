"""Evaluation without motion: forces on a body where it is, or would be; and what broke a frozen one."""

from taichi_soft.constants import LANES
from taichi_soft.kernels.bonds import accumulate_pressures
from taichi_soft.kernels.edges import accumulate_edge_forces, edge_force_of
from taichi_soft.kernels.elastic import lane_forces
from taichi_soft.kernels.internal_forces import clear_forces
from taichi_soft.kernels.loads import forget_loads
from taichi_soft.kernels.motion import particle_is_sound, restore_particle
from taichi_soft.kernels.per_body import advance_body
from taichi_soft.math.finite import is_finite
from taichi_soft.math.tensors import widened
from taichi_soft.runtime import ti


@ti.func
def _add_tet_forces(state: ti.template(), model: ti.template(), body):
    """Returns the first broken tetrahedron (block times `LANES` plus lane) or -1."""
    broken = -1
    blocks = state.body_blocks[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        block, lane = t // LANES, t % LANES
        forces = lane_forces(state, model, block, lane)
        for corner in ti.static(range(4)):
            p = state.tet_vertices[(block * 4 + corner) * LANES + lane]
            if broken < 0 and (particle_is_sound(state, p) & is_finite(forces[corner])) == 0:
                broken = t
            state.particle_force[p] = state.particle_force[p] + widened(forces[corner])
    accumulate_edge_forces(state, model, body)
    return broken


@ti.func
def _add_bond_forces(state: ti.template(), model: ti.template(), body):
    """Returns the first broken edge or -1."""
    broken = -1
    if ti.static(model.reads_expansion):
        accumulate_pressures(state, body)
    accumulate_edge_forces(state, model, body)
    edges = state.body_edges[body]
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        sound = particle_is_sound(state, p) & particle_is_sound(state, q)
        if broken < 0 and (sound & is_finite(edge_force_of(state, model, e))) == 0:
            broken = e
    return broken


@ti.func
def accumulate_forces_one_by_one(state: ti.template(), program: ti.template(), body):
    """Add all internal forces of one body to its particles, element by element.

    Returns the first tetrahedron (block times `LANES` plus lane), or edge where forces act along edges, with
    an end out of reach or a force that is not finite, or -1.
    """
    broken = -1
    for m, model in ti.static(enumerate(program.models)):
        if state.body_model[body] == m:
            if ti.static(model.has_bonds):
                broken = _add_bond_forces(state, model, body)
            else:
                broken = _add_tet_forces(state, model, body)
    return broken


@ti.kernel
def compute_body_forces(
    state: ti.template(), program: ti.template(), body: ti.i32, out: ti.types.ndarray(ndim=2)
):
    """Internal forces on the particles of one body where they are now [N], in kernel order."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        accumulate_forces_one_by_one(state, program, body)
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            for i in ti.static(range(3)):
                out[p - particles[0], i] = state.particle_force[p][i]
            state.particle_force[p] = ti.Vector.zero(state.real, 4)


@ti.kernel
def find_broken_element(
    state: ti.template(),
    program: ti.template(),
    body: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    is_braked: ti.i32,
    found: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Make the last step of a frozen body again, up to the substep in which it breaks, and undo it.

    Args:
        found: receives the tetrahedron (block times `LANES` plus lane) or edge that broke first and the
            substep; left alone where nothing breaks.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        kick = 0.5 * (state.body_velocity_lag[body] + h)
        is_open = 1
        state.body_is_braked[body] = is_braked
        for s in range(substeps + 1):
            if is_open == 1:
                broken = accumulate_forces_one_by_one(state, program, body)
                if broken >= 0:
                    found[0] = broken
                    found[1] = s
                    is_open = 0
                else:
                    clear_forces(state, body)
                    advance_body(state, program, body, h, kick, s, substeps)
                    kick = h
        state.body_is_braked[body] = 0
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            restore_particle(state, p)
        clear_forces(state, body)
        forget_loads(state, body)
