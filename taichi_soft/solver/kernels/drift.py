"""Drift: move particles by their velocities, and collide them with the colliders on their paths.

Groups of fields: reads colliders, faces.
"""

from taichi_soft.bodies.kernels.rigid import drift_rigid, gather_motion, is_rigid, scatter_motion
from taichi_soft.bodies.status import ACTIVE
from taichi_soft.contact.kernels.collide import collide_particle, find_near_colliders, set_travelled
from taichi_soft.contact.kernels.face_colliders import collide_faces, list_near_faces, store_starts
from taichi_soft.contact.kernels.hull_colliders import begin_touches, clear_warm_start, collide_points
from taichi_soft.contact.kernels.hull_points import has_hull, place_points
from taichi_soft.contact.kernels.rebound import limit_rebounds
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.step_fields import Job


@ti.func
def list_near_colliders(state: ti.template(), body, speed, since, left):
    """List the colliders and faces that can touch in the rest of the step, at 1.25 times `speed` [m/s]."""
    place_points(state, body)
    reach = 1.25 * speed * left + 1e-3
    find_near_colliders(state, body, reach, since, left)
    list_near_faces(state, body, reach, since, left)


@ti.func
def can_drift_at_once(state: ti.template(), body, path):
    """Return 1 if a body alone in its island can first move along its next path and then collide.

    The colliders within `path` [m] must be known. A body with a hull near a collider must collide first,
    because the contact of a hull changes velocities before the move.
    """
    is_known = int(state.colliders.gone[body] + path <= state.colliders.reach[body])
    if ti.static(state.capacity.contact.hull):
        is_known = is_known & int(state.colliders.near_count[body] == 0 or not has_hull(state, body))
    return is_known


@ti.func
def _move_block(state: ti.template(), first, count, h):
    """Move up to `LANES` particles from `first` on by their velocities."""
    positions = ti.Matrix.zero(state.real, LANES, 3)
    for lane in range(LANES):
        x = state.particle_position[first + lane] + h * state.particle_velocity[first + lane]
        for i in ti.static(range(3)):
            positions[lane, i] = x[i]
    if count >= LANES:
        for lane in range(LANES):
            for i in ti.static(range(3)):
                state.particle_position[first + lane][i] = positions[lane, i]
    else:
        lane = 0
        while lane < count:
            for i in ti.static(range(3)):
                state.particle_position[first + lane][i] = positions[lane, i]
            lane = row_behind(lane)


@ti.func
def _collide_body(state: ti.template(), body, h, since, travelled):
    """Collide the particles of a body on the path along which they have just moved.

    Args:
        travelled: distance that the body has moved after near colliders were last listed [m]. It includes
            this path.
    """
    particles, has_faces = state.body_particles[body], int(state.faces.near_count[body] > 0)
    if has_faces == 1:
        store_starts(state, body, h, travelled)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        is_clear = ti.Vector.zero(ti.i32, LANES)
        for lane in range(LANES):
            is_clear[lane] = int(state.colliders.particle_clearance[first + lane] > travelled)
        if is_clear.min() == 0:
            p, end = first, ti.min(first + LANES, particles[1])
            while p < end:
                if (
                    not (state.colliders.particle_clearance[p] > travelled)
                    and state.particle_inv_mass[p] > 0.0
                ):
                    collide_particle(state, body, p, h, since)
                p = row_behind(p)
    if has_faces == 1:
        gather_motion(state, body)  # of a rigid body, whose drift has changed its pose
        collide_faces(state, body, h, since, travelled)
        scatter_motion(state, body)
    limit_rebounds(state, body, since + h)


@ti.real_func
def end_drift(state: ti.template(), body: ti.i32, h: ti.f32, since: ti.f32, travelled: ti.f32):
    """Collide a body whose particles have moved.

    Args:
        travelled: distance that the body has moved after near colliders were last listed [m]. It includes
            this path.
    """
    set_travelled(state, body, travelled)
    if state.colliders.near_count[body] > 0:
        _collide_body(state, body, h, since, travelled)
    place_points(state, body)


@ti.func
def _find_colliders(state: ti.template(), body, job):
    """List the near colliders if the list can be incomplete after this substep.

    Returns: 1 if the list is new; the distance travelled at the end of the substep [m], see `end_drift`.
    """
    travelled = state.colliders.gone[body] + job.fastest * job.h
    is_new = int(not (state.colliders.reach[body] >= travelled))
    if is_new == 1:
        list_near_colliders(state, body, job.fastest, job.since, job.left)
        travelled = job.fastest * job.h
    return is_new, travelled


@ti.func
def begin_collisions(state: ti.template(), body, job):
    """List the contacts of a rigid body with colliders, before contact between bodies is solved."""
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body) and state.body_status[body] == ACTIVE:
            _, travelled = _find_colliders(state, body, job)
            if state.colliders.near_count[body] > 0:
                begin_touches(state, body, job.h, job.since, travelled)


@ti.real_func
def drift_body(state: ti.template(), body: ti.i32, job: Job):
    """Move the particles of one body by their velocities, and collide them on their paths."""
    is_new, travelled = _find_colliders(state, body, job)
    if ti.static(state.capacity.contact.hull):
        if state.colliders.near_count[body] > 0:
            collide_points(state, body, job.h, job.since, travelled)
        elif is_new == 1:
            clear_warm_start(state, body)
    has_moved = 0
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body):
            has_moved = drift_rigid(state, body, job.h)
    if has_moved == 0:
        particles = state.body_particles[body]
        for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
            first = (particles[0] + block * LANES) & ROW_BITS
            _move_block(state, first, particles[1] - first, job.h)
    end_drift(state, body, job.h, job.since, travelled)


@ti.func
def has_drifted(state: ti.template(), body, speed, h, since):
    """Collide a body that the kick has moved, or undo the move if the colliders near the body are unknown.

    Returns: 1 if the move was not undone.
    """
    is_known = can_drift_at_once(state, body, speed * h)
    if is_known == 1:
        end_drift(state, body, h, since, state.colliders.gone[body] + speed * h)
    else:
        particles = state.body_particles[body]
        p = particles[0]
        while p < particles[1]:
            state.particle_position[p] = state.particle_position[p] - h * state.particle_velocity[p]
            p = row_behind(p)
    return is_known
