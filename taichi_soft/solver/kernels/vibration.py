"""Damp vibrations, that is, all motion of a body relative to its rigid motion.

Velocities v become P v + k (v - P v). P v is the rigid motion with the momentum and angular momentum of v,
and k = exp(-2 zeta w seconds), with the angular frequency w of the body's first mode and its damping ratio
zeta. Damping acts on the velocities at the time of the positions, in the middle of a kick. There leapfrog
conserves, for each mode of frequency w,

    v^2 + w^2 (1 - h^2 w^2 / 4) x^2.

A smaller v reduces this quantity, for every stable step and any interval of damping. For velocities half a
step later, the conserved quantity also contains h w^2 x v. Damping these velocities every third substep,
for example, would excite modes with a period of three substeps.

Groups of fields: reads islands.
"""

from taichi_soft.bodies.kernels.origins import local_floor
from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.bodies.status import FEELS_REACTION
from taichi_soft.contact.distances.floor import resolve_floor
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.elementary import exp
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.untangling import kept_while_inverted

MAX_FADING = 0.43
"""Largest exponent of damping in one substep. With 0.43, the fraction d = exp(-0.43) = 0.65 of the vibration
remains. The limit keeps particles in contact stable. For them, the kick is not part of the damped vibration,
so the velocity v of a mode with stiffness k and mass 1 becomes d v + h a. The substep is then stable for
h^2 k < 2 (1 + d), which is up to 0.9 of leapfrog's longest step. Failed bodies are damped more strongly, once
per step."""

RESTING_RATE = 2.0
"""Smallest decay rate of the vibrations of a body whose mean speed is below `sleep_speed` [1/s]."""

STRONG_DAMPING = 0.5
"""Fraction of the vibration that remains after each substep of the last attempt at a step."""

FARTHEST = 0.1
"""Largest displacement of a particle relative to the body's rigid motion in one substep of the last
attempt, as a fraction of the mean edge length of the surface."""

THIN_BODY = 1e-6
"""Limit below which a body counts as a straight line. It is compared with the product of the principal
moments of inertia divided by the cube of their sum. For a straight line, this value is 0."""


@ti.func
def _solve_symmetric(rows: ti.template(), b):
    """Return the solution x of A x = b. `rows` are the rows of A, which is symmetric with a trace of 1."""
    a0, a1, a2 = rows
    c0, c1, c2 = a1.cross(a2), a2.cross(a0), a0.cross(a1)
    det = a0.dot(c0)
    if det < THIN_BODY:
        more = 1e-3
        a0, a1, a2 = a0 + ti.Vector([more, 0, 0]), a1 + ti.Vector([0, more, 0]), a2 + ti.Vector([0, 0, more])
        c0, c1, c2 = a1.cross(a2), a2.cross(a0), a0.cross(a1)
        det = a0.dot(c0)
    return ti.Vector([c0.dot(b), c1.dot(b), c2.dot(b)]) / det


@ti.func
def _kicked_velocity(state: ti.template(), p, gravity, kick):
    """Return the velocity of a particle after its forces have acted for `kick` [s], in m/s. A pinned particle
    keeps its own velocity.
    """
    inv_mass = state.particle_inv_mass[p]
    change = kick * (state.particle_force[p].xyz * inv_mass + gravity)
    return state.particle_velocity[p] + ti.select(inv_mass > 0.0, 1.0, 0.0) * change


@ti.func
def felt_velocity(state: ti.template(), program: ti.template(), p, gravity, kick, h, is_held):
    """Return the velocity of a particle after its forces have acted for `kick` [s], in m/s.

    If `is_held` is 1, the velocity includes the effect of contact.

    Contact removes the speed that a pressed particle gains in the kick. If that speed counted as vibration,
    damping would move bodies at rest. The effect of the floor in a substep of `h` [s] is known in advance.
    For other contacts, the effect in the last substep is used.
    """
    velocity = _kicked_velocity(state, p, gravity, kick)
    if is_held == 1:
        if ti.static(program.has_contact):
            if state.particle_touches[p] == 1:
                velocity = state.particle_velocity[p]
        if ti.static(program.has_floor):
            if state.particle_inv_mass[p] > 0.0:
                place = state.particle_position[p] + h * velocity
                _, velocity = resolve_floor(place, velocity, h, local_floor(state, state.particle_body[p]))
    return velocity


@ti.func
def _column_sums(rows: ti.template()):
    total = ti.Vector([rows[0, i] * 0.0 for i in ti.static(range(3))])
    for lane in ti.static(range(LANES)):
        for i in ti.static(range(3)):
            total[i] += rows[lane, i]
    return total


@ti.func
def _rigid_motion(state: ti.template(), program: ti.template(), body, kick, h, is_held, x0, v0):
    """Return the rigid motion of a body after its forces have acted for `kick` [s]. For `h` and `is_held`,
    see `felt_velocity`.

    Returns: centre relative to x0 [m], velocity relative to v0 [m/s], and angular velocity [rad/s].
    """
    particles, gravity = state.body_particles[body], gravity_on(state, body)
    masses = ti.Vector.zero(state.real, LANES)
    arms, momenta = ti.Matrix.zero(state.real, LANES, 3), ti.Matrix.zero(state.real, LANES, 3)
    turns = ti.Matrix.zero(state.real, LANES, 3)
    squares, products = ti.Matrix.zero(state.real, LANES, 3), ti.Matrix.zero(state.real, LANES, 3)
    count = particles[1] - particles[0]
    for block in range((count + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        for lane in range(LANES):
            p = first + lane
            # Rows beyond the last particle belong to another body. A mass of 0 is not enough to exclude them,
            # because 0 times a non-finite number is NaN.
            is_own = block * LANES + lane < count
            mass = ti.select(is_own, state.particle_mass[p], 0.0)
            x = ti.select(is_own, state.particle_position[p], x0) - x0
            felt = felt_velocity(state, program, p, gravity, kick, h, is_held)
            v = ti.select(is_own, felt, v0) - v0
            arm, momentum = mass * x, mass * v
            turn = x.cross(momentum)
            masses[lane] += mass
            for i in ti.static(range(3)):
                arms[lane, i] += arm[i]
                momenta[lane, i] += momentum[i]
                turns[lane, i] += turn[i]
                squares[lane, i] += arm[i] * x[i]
                products[lane, i] += arm[i] * x[(i + 1) % 3]
    share = 1.0 / masses.sum()
    center, velocity = share * _column_sums(arms), share * _column_sums(momenta)
    spin = share * _column_sums(turns) - center.cross(velocity)
    s = share * _column_sums(squares) - center * center  # xx, yy, zz
    d = share * _column_sums(products) - center * ti.Vector([center.y, center.z, center.x])  # xy, yz, zx
    trace = 2.0 * s.sum()
    angular_velocity = ti.Vector.zero(state.real, 3)
    if trace > 0.0:
        rows = (
            ti.Vector([s.y + s.z, -d.x, -d.z]) / trace,
            ti.Vector([-d.x, s.z + s.x, -d.y]) / trace,
            ti.Vector([-d.z, -d.y, s.x + s.y]) / trace,
        )
        angular_velocity = _solve_symmetric(rows, spin / trace)
    return center, velocity, angular_velocity


@ti.func
def fade_vibration(state: ti.template(), program: ti.template(), body, kick, h, keep):
    """Scale a body's vibration by `keep`. The vibration is measured after forces have acted for `kick` [s].

    `h` is the length of the substep [s].
    """
    particles, gravity = state.body_particles[body], gravity_on(state, body)
    x0, v0 = state.particle_position[particles[0]], state.particle_velocity[particles[0]]
    center, velocity, angular_velocity = _rigid_motion(state, program, body, kick, h, 1, x0, v0)
    count = particles[1] - particles[0]
    for block in range((count + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        changes = ti.Matrix.zero(state.real, LANES, 3)
        for lane in range(LANES):
            p = first + lane
            x = state.particle_position[p] - x0
            rigid = velocity + angular_velocity.cross(x - center)
            change = (1.0 - keep) * (rigid + v0 - felt_velocity(state, program, p, gravity, kick, h, 1))
            for i in ti.static(range(3)):
                changes[lane, i] = change[i]
        for lane in range(ti.min(LANES, count - block * LANES)):
            p = first + lane
            change = ti.Vector([changes[lane, i] for i in ti.static(range(3))])
            if state.particle_inv_mass[p] > 0.0:
                state.particle_velocity[p] = state.particle_velocity[p] + change
            elif state.body_drives[body] & FEELS_REACTION != 0:
                impulse = state.particle_mass[p] * change  # impulse on the pin
                state.particle_reaction[p] = state.particle_reaction[p] + impulse


@ti.func
def _limit_vibration(state: ti.template(), program: ti.template(), body, kick, farthest):
    """Limit the speed of particles relative to the body's rigid motion to `farthest` [m/s].

    Speeds are measured after forces have acted for `kick` [s]. Momentum and angular momentum are conserved.
    """
    particles, gravity = state.body_particles[body], gravity_on(state, body)
    x0, v0 = state.particle_position[particles[0]], state.particle_velocity[particles[0]]
    center, velocity, spin = x0 * 0.0, v0 * 0.0, v0 * 0.0
    for turn in range(2):  # first limit the speeds, then restore the rigid motion
        center_now, velocity_now, spin_now = _rigid_motion(state, program, body, kick, 0.0, 0, x0, v0)
        if turn == 0:
            center, velocity, spin = center_now, velocity_now, spin_now
        p = particles[0]
        while p < particles[1]:
            if state.particle_inv_mass[p] > 0.0:
                arm = state.particle_position[p] - x0 - center
                change = velocity - velocity_now + (spin - spin_now).cross(arm)
                if turn == 0:
                    kicked = _kicked_velocity(state, p, gravity, kick)
                    rigid = v0 + velocity + spin.cross(arm)
                    change = rigid + _limited(kicked - rigid, farthest) - kicked
                state.particle_velocity[p] = state.particle_velocity[p] + change
            p = row_behind(p)


@ti.func
def _limited(beside, most):
    """Return a velocity relative to the rigid motion, limited to `most` [m/s]."""
    speed = beside.norm()
    slower = ti.select(speed < most, beside, beside * (most / ti.max(speed, 1e-30)))
    if not speed < 1e18:  # the square of the speed overflowed, so the direction is unknown
        slower = beside * 0.0
    return slower


@ti.func
def kept_vibration(state: ti.template(), body, h, s, substeps):
    """Return the fraction of a body's vibration that remains after substep `s` of `substeps` of `h` [s] each.

    The fraction is below 1 only every few substeps, but many times in a period of the first mode. The
    intervals vary, because a mode that is always damped at its turning points would last for ever.
    """
    keep, rate, interval = 1.0, state.body_fading[body], state.body_fading_interval[body]
    if state.body_is_braked[body] == 1:
        keep = STRONG_DAMPING
    elif rate > 0.0:
        if ti.static(state.capacity.has_contact):
            if state.islands.mean_speed[body] <= state.sleep_speed[None] and state.sleep_speed[None] > 0.0:
                rate = ti.max(rate, RESTING_RATE)
        whole = substeps * h
        wanted = ti.ceil(whole * ti.max(1.0 / interval, rate / MAX_FADING))
        times = ti.min(substeps, ti.cast(ti.min(wanted, 1e6), ti.i32))
        while times < substeps and substeps % times == 0:
            times += 1
        if (s + 1) * times // substeps > s * times // substeps:
            keep = exp(-ti.min(rate * whole / times, MAX_FADING))
    return keep


@ti.func
def time_to_positions(program: ti.template(), kick, h):
    """Return the part of a kick [s] after which velocities are at the time of the positions, in a substep of
    `h` [s].
    """
    return kick - program.integrator.lag * h


@ti.func
def damp_vibration(state: ti.template(), program: ti.template(), body, kick, h, s, substeps):
    """Damp the vibration of a body in substep `s` of `substeps` of `h` [s] each.

    Call this before the body's forces act for `kick` [s]. The damping acts on the velocities in the middle of
    that kick.
    """
    keep = kept_vibration(state, body, h, s, substeps)
    if keep < 1.0:
        fade_vibration(state, program, body, time_to_positions(program, kick, h), h, keep)
    if state.body_is_braked[body] == 1:
        _limit_vibration(state, program, body, kick, FARTHEST * state.body_edge[body] / h)


@ti.real_func
def _fade_body(
    state: ti.template(), program: ti.template(), body: ti.i32, kick: ti.f32, h: ti.f32, keep: ti.f32
):
    fade_vibration(state, program, body, kick, h, keep)


@ti.real_func
def _limit_body(state: ti.template(), program: ti.template(), body: ti.i32, kick: ti.f32, farthest: ti.f32):
    _limit_vibration(state, program, body, kick, farthest)


@ti.func
def damp_body(state: ti.template(), program: ti.template(), body, kick, h, s, substeps):
    """Damp a body on a CPU as `damp_vibration` does, and more strongly if it has inverted tetrahedra.

    Each part is called only once, so that LLVM inlines it and its rounding does not depend on the rest of the
    program.
    """
    keep = kept_vibration(state, body, h, s, substeps)
    keep *= kept_while_inverted(state, body, h, s == 0)
    if keep < 1.0:
        _fade_body(state, program, body, time_to_positions(program, kick, h), h, keep)
    if state.body_is_braked[body] == 1:
        _limit_body(state, program, body, kick, FARTHEST * state.body_edge[body] / h)
