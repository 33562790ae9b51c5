"""Schedule `flat`: all tetrahedra, then all particles, of all bodies in parallel, substep by substep.

For bodies too large for one thread. Forces are stored per corner and per edge, and each particle gathers
its own in a fixed order, so the result does not depend on the number of threads.

On a CPU the substeps lie inside one kernel call: one task per thread, which meet at a spinning barrier.
Waking a thread pool costs 5 to 90 us per loop, a barrier well under one. All tasks of a loop run at
once because Taichi's pool has exactly that many threads. The price: where other programs keep a core busy,
every barrier may wait for the operating system, which is why only very large bodies use this by themselves.
A GPU has no such barrier: there each substep is a launch of its own.
"""

from taichi_soft.constants import LANES
from taichi_soft.kernels.bonds import lane_pressure, store_block_pressures
from taichi_soft.kernels.edges import edge_force_of
from taichi_soft.kernels.elastic import store_block_forces, store_lane_forces
from taichi_soft.kernels.motion import (
    gravity_on,
    move_particle,
    particle_is_sound,
    remember_particle,
    restore_particle,
)
from taichi_soft.kernels.plasticity import flow_block
from taichi_soft.runtime import ti
from taichi_soft.state import ABSENT, ACTIVE, FROZEN

_FAILING = 4  # above the status of any body


@ti.func
def _status_of(state: ti.template(), p):
    return state.body_status[state.particle_body[p]]


@ti.func
def _block_is_active(state: ti.template(), block):
    return _status_of(state, state.tet_vertices[block * 4 * LANES]) == ACTIVE


@ti.func
def _remember_phase(state: ti.template(), p):
    if _status_of(state, p) != ABSENT:
        remember_particle(state, p)


@ti.func
def _block_phase(state: ti.template(), program: ti.template(), block):
    is_active = _block_is_active(state, block)
    for m, model in ti.static(enumerate(program.models)):
        if is_active and state.block_model[block] == m:
            if ti.static(not model.has_bonds):
                store_block_forces(state, model, block)
            elif ti.static(model.reads_expansion):
                store_block_pressures(state, block)


@ti.func
def _edge_phase(state: ti.template(), program: ti.template(), e):
    body = state.particle_body[state.edge_vertices[e][0]]
    is_active = state.body_status[body] == ACTIVE
    for m, model in ti.static(enumerate(program.models)):
        if is_active and state.body_model[body] == m:
            state.edge_force[e] = edge_force_of(state, model, e)


@ti.func
def gathered_force(state: ti.template(), p):
    """Internal force on one particle [N]: its corners' forces, then its edges'."""
    total = ti.Vector.zero(state.real, 4)
    corners = state.particle_corners[p]  # none in bodies whose law looks at edges
    for k in range(corners[0], corners[1]):
        total += state.corner_force[state.corner_slot[k]]
    force = total.xyz
    edges = state.particle_edges[p]
    for k in range(edges[0], edges[1]):
        e = state.incident_edge[k]
        if e >= 0:
            force += state.edge_force[e]
        else:
            force -= state.edge_force[-1 - e]
    return force


@ti.func
def _move_phase(state: ti.template(), program: ti.template(), p, h, is_first):
    body = state.particle_body[p]
    if state.body_status[body] == ACTIVE:
        kick = h
        if is_first:
            kick = 0.5 * (state.body_velocity_lag[body] + h)
        move_particle(state, program, p, gathered_force(state, p), gravity_on(state, body), h, kick)


@ti.func
def _check_phase(state: ti.template(), p):
    if _status_of(state, p) == ACTIVE and particle_is_sound(state, p) == 0:
        ti.atomic_max(state.body_status[state.particle_body[p]], _FAILING)


@ti.func
def _fall_back_phase(state: ti.template(), p):
    if _status_of(state, p) == _FAILING:
        restore_particle(state, p)


@ti.func
def _flow_phase(state: ti.template(), block, dt):
    body = state.particle_body[state.tet_vertices[block * 4 * LANES]]
    if state.body_status[body] == ACTIVE:
        flow_block(state, body, block, dt)


@ti.func
def _settle_body(state: ti.template(), body, h):
    failed = 0
    if state.body_status[body] == _FAILING:
        state.body_status[body] = FROZEN
        failed = 1
    elif state.body_status[body] == ACTIVE:
        state.body_velocity_lag[body] = h
    return failed


@ti.func
def _meet(state: ti.template(), worker_count: ti.template()):
    """Wait until all workers have come here as often as this one."""
    arrived = ti.atomic_add(state.barrier[0], 1) + 1
    target = (arrived + worker_count - 1) // worker_count * worker_count
    # A maximum with -1 changes nothing; it is here because it cannot be optimised into a plain load.
    while ti.atomic_max(state.barrier[0], -1) < target:
        pass


@ti.kernel
def step_flat_cpu(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    block_count: ti.i32,
    edge_count: ti.i32,
    particle_count: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
) -> ti.i32:
    """One fixed step of all bodies by `program.worker_count` threads. Returns how many failed."""
    failed = 0
    state.barrier[0] = 0
    ti.loop_config(block_dim=1)
    for worker in range(program.worker_count):
        workers = program.worker_count
        p0, p1 = particle_count * worker // workers, particle_count * (worker + 1) // workers
        b0, b1 = block_count * worker // workers, block_count * (worker + 1) // workers
        e0, e1 = edge_count * worker // workers, edge_count * (worker + 1) // workers
        for p in range(p0, p1):
            _remember_phase(state, p)
        for s in range(substeps):
            for block in range(b0, b1):
                _block_phase(state, program, block)
            if ti.static(program.reads_expansion):
                _meet(state, workers)
            for e in range(e0, e1):
                _edge_phase(state, program, e)
            _meet(state, workers)
            for p in range(p0, p1):
                _move_phase(state, program, p, h, s == 0)
            _meet(state, workers)
        for p in range(p0, p1):
            _check_phase(state, p)
        _meet(state, workers)
        for p in range(p0, p1):
            _fall_back_phase(state, p)
        if ti.static(program.has_plasticity):
            for block in range(b0, b1):
                _flow_phase(state, block, substeps * h)
    ti.loop_config(serialize=True)
    for body in range(body_count):
        failed += _settle_body(state, body, h)
    return failed


@ti.kernel
def begin_flat(state: ti.template(), particle_count: ti.i32):
    """Remember where every particle is."""
    for p in range(particle_count):
        _remember_phase(state, p)


@ti.kernel
def substep_flat(
    state: ti.template(),
    program: ti.template(),
    block_count: ti.i32,
    edge_count: ti.i32,
    particle_count: ti.i32,
    h: ti.f32,
    is_first: ti.i32,
):
    """One substep with one tetrahedron, edge or particle per thread."""
    for t in range(block_count * LANES):
        block, lane = t // LANES, t % LANES
        is_active = _block_is_active(state, block)
        for m, model in ti.static(enumerate(program.models)):
            if is_active and state.block_model[block] == m:
                if ti.static(not model.has_bonds):
                    store_lane_forces(state, model, block, lane)
                elif ti.static(model.reads_expansion):
                    state.tet_pressure[t] = lane_pressure(state, block, lane)
    for e in range(edge_count):
        _edge_phase(state, program, e)
    for p in range(particle_count):
        _move_phase(state, program, p, h, is_first)


@ti.kernel
def end_flat(
    state: ti.template(),
    program: ti.template(),
    body_count: ti.i32,
    block_count: ti.i32,
    particle_count: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
) -> ti.i32:
    """Freeze what went non-finite. Returns how many bodies failed."""
    failed = 0
    for p in range(particle_count):
        _check_phase(state, p)
    for p in range(particle_count):
        _fall_back_phase(state, p)
    if ti.static(program.has_plasticity):
        for block in range(block_count):
            _flow_phase(state, block, substeps * h)
    for body in range(body_count):
        failed += _settle_body(state, body, h)
    return failed
