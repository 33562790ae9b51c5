"""Frames and spins of rods: how edges spin, what clamps them, and what moves or replaces them.

`elements.kernels.rods` says what the rows are.
"""

from taichi_soft.bodies.status import FEELS_REACTION, WITH_FRAME
from taichi_soft.core.math.elementary import atan2
from taichi_soft.core.math.quaternion import quaternion_of_axes, spun, turned
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.rods import direction_of, edges_end, particle_after
from taichi_soft.elements.laws.rod import edge_direction, followed, half_strain, product

RIGIDITY = 1e-4
"""Weight, relative to that of all edges, that keeps the angular velocity of a straight rod about itself at
zero."""


@ti.func
def _is_clamped(state: ti.template(), p, q):
    """1 if both ends of an edge are pinned. Such an edge does not spin, except with a frame."""
    return int(state.particle_inv_mass[p] == 0.0 and state.particle_inv_mass[q] == 0.0)


@ti.func
def _is_with_frame(state: ti.template(), p, q):
    """1 if both ends of a clamped edge are attached to the same frame."""
    aim = state.particle_aim[p]
    return int(aim >= WITH_FRAME and aim == state.particle_aim[q])


@ti.real_func
def spin_edges(state: ti.template(), body: ti.i32, h: ti.f32, felt: ti.f32):
    """Change the spin of a rod's edges by the moments, which act for `felt` [s], and turn the frames for
    `h` [s].

    Pins hold clamped edges, but `aim_spins` sets the spin of those that are attached to a frame.
    """
    if state.body_rod[body] > 0:
        for p in range(state.body_particles[body][0], edges_end(state, body)):
            spin, frame, q = state.rod_spin[p], state.rod_frame[p], particle_after(state, body, p)
            if _is_clamped(state, p, q) == 0:
                spin += felt * state.rod_torque[p] / state.rod_edge[p].z
            elif _is_with_frame(state, p, q) == 0:
                spin *= 0.0
            elif state.body_drives[body] & FEELS_REACTION != 0:
                impulse = felt * state.rod_torque[p] * edge_direction(frame)
                state.rod_reaction[p] = state.rod_reaction[p] + impulse
            state.rod_spin[p] = spin
            state.rod_frame[p] = spun(frame, h * spin * edge_direction(frame))


@ti.func
def damp_spins(state: ti.template(), body, keep):
    """Multiply the spin of all free edges of a rod by `keep`."""
    if state.body_rod[body] > 0:
        for p in range(state.body_particles[body][0], edges_end(state, body)):
            if _is_clamped(state, p, particle_after(state, body, p)) == 0:
                state.rod_spin[p] = keep * state.rod_spin[p]


@ti.func
def _matrix_frame(poses: ti.template(), row):
    """Return the quaternion of a pose: rotation matrix by rows, and position, (12,)."""
    x = ti.Vector([poses[row, 0], poses[row, 3], poses[row, 6]])
    y = ti.Vector([poses[row, 1], poses[row, 4], poses[row, 7]])
    z = ti.Vector([poses[row, 2], poses[row, 5], poses[row, 8]])
    return quaternion_of_axes(x, y, z)


@ti.func
def _turn_about(state: ti.template(), p, q, frames: ti.template()):
    """Return the angle by which an edge turns about itself with its frame in the next step [rad].

    It is the rotation of the frame without the smallest rotation that changes the edge's direction as much.
    """
    row = state.particle_aim[p] - WITH_FRAME
    back = _matrix_frame(frames, row + frames.shape[0] // 2)
    back = ti.Vector([-back.x, -back.y, -back.z, back.w])
    turn = product(_matrix_frame(frames, row), back)
    direction, _ = direction_of(state, p, q)
    frame = followed(state.rod_frame[p], direction)
    after, both = followed(frame, turned(turn, direction)), product(turn, frame)
    about = after.w * both.xyz - both.w * after.xyz - after.xyz.cross(both.xyz)
    sine, cosine = about.z, both.dot(after)
    if cosine < 0.0:
        sine, cosine = -sine, -cosine
    return 2.0 * atan2(sine, cosine)


@ti.func
def aim_spins(state: ti.template(), body, dt, frames: ti.template()):
    """Set the spin of a rod's clamped edges for a step of `dt` [s].

    An edge whose ends are both attached to the same frame turns with it. Others do not spin.
    Args:
        frames: see `aim_pinned`.
    """
    if state.body_rod[body] > 0:
        for p in range(state.body_particles[body][0], edges_end(state, body)):
            q, reaction = particle_after(state, body, p), ti.Vector.zero(ti.f32, 3)
            if _is_clamped(state, p, q) == 1:
                spin = ti.cast(0.0, ti.f32)
                if _is_with_frame(state, p, q) == 1:
                    spin = _turn_about(state, p, q, frames) / dt
                    direction, _ = direction_of(state, p, q)
                    reaction = state.rod_edge[p].z * (state.rod_spin[p] - spin) * direction
                state.rod_spin[p] = spin
            state.rod_reaction[p] = reaction


@ti.func
def set_rigid_spins(state: ti.template(), body, angular):
    """Give the free edges of a rod the spin of a body that turns with the velocity `angular` [rad/s]."""
    if state.body_rod[body] > 0:
        for p in range(state.body_particles[body][0], edges_end(state, body)):
            q = particle_after(state, body, p)
            if _is_clamped(state, p, q) == 0:
                direction, _ = direction_of(state, p, q)
                state.rod_spin[p] = angular.dot(direction)


@ti.func
def turn_frames(state: ti.template(), body, axes, factor):
    """Rotate the frames of a rod like its particles, and multiply its spins by `factor`.

    Args: axes: rotation matrix.
    """
    if state.body_rod[body] > 0:
        turn = quaternion_of_axes(axes[:, 0], axes[:, 1], axes[:, 2])
        for p in range(state.body_particles[body][0], edges_end(state, body)):
            q = particle_after(state, body, p)
            direction, _ = direction_of(state, p, q)
            state.rod_frame[p] = followed(product(turn, state.rod_frame[p]), direction)
            state.rod_spin[p] = factor * state.rod_spin[p]


@ti.func
def _lay_frames(state: ti.template(), body):
    """Give a rod frames without torsion. Return the angle by which they must turn about their edges.

    Bending then agrees best with that at rest.
    """
    particles, frame = state.body_particles[body], ti.Vector.zero(state.real, 4)
    frame.w = 1.0
    sine, cosine = frame.x, frame.x
    for p in range(particles[0], edges_end(state, body)):
        direction, _ = direction_of(state, p, particle_after(state, body, p))
        moved = followed(frame, direction)
        if p > particles[0]:
            s, rest = half_strain(frame, moved), state.rod_rest[p]
            weight = state.rod_joint[p].x
            sine += weight * (rest.x * s.y - rest.y * s.x)
            cosine += weight * (rest.x * s.x + rest.y * s.y)
        state.rod_frame[p] = moved
        frame = moved
    return atan2(sine, cosine)


@ti.real_func
def place_frames(state: ti.template(), body: ti.i32):
    """Give a rod the frames and spins that fit the positions and velocities of its particles.

    The rod has no torsion beside that of its rest shape, and turns about its edges like the rigid body whose
    motion is nearest to its own.
    """
    if state.body_rod[body] > 0:
        particles, angle = state.body_particles[body], _lay_frames(state, body)
        inertia, motion = ti.Matrix.zero(state.real, 3, 3), ti.Vector.zero(state.real, 3)
        for p in range(particles[0], edges_end(state, body)):
            q, frame = particle_after(state, body, p), state.rod_frame[p]
            direction = edge_direction(frame)
            state.rod_frame[p] = spun(frame, angle * direction)
            _, inverse = direction_of(state, p, q)
            apart = state.particle_velocity[q] - state.particle_velocity[p]
            motion += direction.cross(apart) * inverse
            for i in ti.static(range(3)):
                inertia[i, i] += 1.0 + RIGIDITY
            inertia -= direction.outer_product(direction)
        angular = inertia.inverse() @ motion
        for p in range(particles[0], edges_end(state, body)):
            state.rod_spin[p] = 0.0
        set_rigid_spins(state, body, angular)


@ti.func
def save_frames(state: ti.template(), body):
    """Save the frames and spins of a rod before a step, for retries."""
    if state.body_rod[body] > 0:
        for p in range(state.body_particles[body][0], state.body_particles[body][1]):
            state.prev_rod_frame[p] = state.rod_frame[p]
            state.prev_rod_spin[p] = state.rod_spin[p]
            state.prev_rod_reaction[p] = state.rod_reaction[p]


@ti.func
def restore_frames(state: ti.template(), body):
    """Restore the frames and spins that `save_frames` saved."""
    if state.body_rod[body] > 0:
        for p in range(state.body_particles[body][0], state.body_particles[body][1]):
            state.rod_frame[p] = state.prev_rod_frame[p]
            state.rod_spin[p] = state.prev_rod_spin[p]
            state.rod_reaction[p] = state.prev_rod_reaction[p]


@ti.func
def stop_spins(state: ti.template(), body):
    """Stop the spin of all edges of a rod."""
    if state.body_rod[body] > 0:
        for p in range(state.body_particles[body][0], state.body_particles[body][1]):
            state.rod_spin[p] = 0.0


@ti.kernel
def read_frames(
    state: ti.template(),
    begin: ti.i32,
    frames: ti.types.ndarray(dtype=ti.f32, ndim=2),
    spins: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Write the frame of each edge as a quaternion, (n, 4), and its spin, (n,) [rad/s]. See the module."""
    ti.loop_config(serialize=True)
    for i in range(spins.shape[0]):
        for k in ti.static(range(4)):
            frames[i, k] = state.rod_frame[begin + i][k]
        spins[i] = state.rod_spin[begin + i]
