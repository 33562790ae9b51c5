"""Joints: their fields and their solver.

A joint holds points of one body at points embedded in tetrahedra of another body. Each pair of points has a
row. The held points of a soft body are particles.

In every substep, Gauss-Seidel sweeps over the rows apply impulses that equalise the velocities of each held
particle and its point. For any masses, this method adds no energy, and there is no stiffness that could be
too high. Successive sweeps have opposite directions. With only one direction, the remaining errors would act
as non-conservative forces, and bodies would flutter.

Remaining gaps are closed no faster than the bodies can follow.

The impulse on a point is distributed over the point's tetrahedron so that it acts at the position of the held
particle. Momentum and angular momentum are therefore conserved even if there is a gap.

Groups of fields: reads islands, rigid; writes joints.
"""

from taichi_soft.bodies.kernels.particles import inv_mass_of, velocity
from taichi_soft.bodies.kernels.rigid import is_rigid, push_rigid, rigid_mobility, rigid_velocity
from taichi_soft.bodies.status import ABSENT, FEELS_REACTION, JOINED
from taichi_soft.core.field_table import BODY, FINITE, PARTICLE, Below, FieldGroup, declare
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.math.quaternion import matrix_of
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

MOST_JOINTS, JOINT_ROWS = 64, 2048
"""MOST_JOINTS is the largest number of joints of a world. JOINT_ROWS is the largest number of particles
that all joints hold together."""

HOLDERS, ENDS = 4, 8
"""ENDS is the number of particles of a row. The first `HOLDERS` carry the held point, and their weights sum
to 1. For a soft body, this point is the first particle, and the others have weight 0. The other four
particles belong to the other body, and their weights sum to -1. The weighted sum of all positions is the
gap between the two points."""

SWEEPS = 6
"""Number of sweeps over all rows of an island in each substep. It must be even, because successive sweeps
have opposite directions. If no particle belongs to two rows, one sweep would be enough."""

CLOSE = 30.0
"""Rate at which a gap closes [1/s]. Rows between a fine and a coarse mesh can contradict each other. At a
higher rate, such rows would shake light bodies."""

MOST_SHIFT = 0.5
"""Largest change of a point's weights. Weights are changed so that the impulse on the point acts at the
position of the held particle. If a gap requires a larger change, the joint does not conserve angular
momentum exactly."""


MOST_WEIGHT = 1e3
"""Largest valid weight of a particle in the rows of a snapshot."""

ALL_JOINTS, USED_JOINT_ROWS, JOINT_ENDS = "joints", "rows of joints", "ends of joints"
"""Groups of rows in a snapshot: all joints, the rows in use, and the particles of these rows."""


class JointFields(FieldGroup):
    """All joints of a world, and their rows. Rows are in the order of creation, without gaps.

    Particle k of row r has the index r ENDS + k.
    """

    owner, when = "control", "has_contact"
    bodies = declare(  # indices plus 1, 0 if unused
        MOST_JOINTS, ti.i32, 2, start=0, keep=ALL_JOINTS, below=Below(BODY, 1), native=True
    )
    rows = declare(  # range of the joint's rows
        MOST_JOINTS, ti.i32, 2, keep=ALL_JOINTS, below=Below(beside=JOINT_ROWS + 1), native=True
    )
    # Largest closing speed of a gap.
    draw_speed = declare(MOST_JOINTS, ti.f32, unit="m/s", keep=ALL_JOINTS, most=FINITE)
    # Impulse on the first body in the last step.
    impulse = declare(MOST_JOINTS, ti.f32, 3, unit="N s", keep=ALL_JOINTS, native=True)
    # Mean force of a step above which the joint breaks; 0 for never.
    break_force = declare(MOST_JOINTS, ti.f32, unit="N", start=0, keep=ALL_JOINTS, most=FINITE, native=True)
    particle = declare(JOINT_ROWS * ENDS, ti.i32, start=0, keep=JOINT_ENDS, below=Below(PARTICLE))
    weight = declare(JOINT_ROWS * ENDS, ti.f32, start=0, keep=JOINT_ENDS, most=MOST_WEIGHT)
    # Fraction of the row's impulse that acts on the particle.
    share = declare(JOINT_ROWS * ENDS, ti.f32, start=0, keep=JOINT_ENDS)
    # Impulse on the held particle in the last substep.
    row_impulse = declare(JOINT_ROWS, ti.f32, 3, unit="N s", keep=USED_JOINT_ROWS)
    approach = declare(JOINT_ROWS, ti.f32, 3, unit="m/s")  # target rate of change of the gap
    # Direction in which a joint of two rigid bodies lets its points slide, in the frame of the second body's
    # principal axes; zero if it lets them slide in no direction.
    axis = declare(MOST_JOINTS, ti.f32, 3, start=0, keep=ALL_JOINTS, most=FINITE)
    is_held = declare(PARTICLE, ti.i32, start=0)  # 1 if a joint holds the particle


@ti.func
def _held_point(state: ti.template(), r):
    """Return the position of the held point of a row [m]."""
    x = ti.Vector.zero(ti.f32, 3)
    for k in range(r * ENDS, r * ENDS + HOLDERS):
        x += state.joints.weight[k] * state.particle_position[state.joints.particle[k]]
    return x


@ti.func
def _sliding_axis(state: ti.template(), j):
    """Return the unit vector along which the points of a joint can slide; zero if there is none."""
    axis = ti.Vector.zero(ti.f32, 3)
    if ti.static(state.capacity.contact.rigid):
        own = state.joints.axis[j]
        if ti.abs(own).max() > 0.0:
            axis = matrix_of(state.rigid.rotation[state.joints.bodies[j][1] - 1]) @ own
    return axis


@ti.func
def _open_row(state: ti.template(), j, r, h, draw_speed):
    """Compute a row's `share` and `approach` for this substep."""
    at = r * ENDS
    gap = ti.Vector.zero(ti.f32, 3)
    for k in range(at, at + ENDS):
        gap += state.joints.weight[k] * state.particle_position[state.joints.particle[k]]
        state.joints.share[k] = state.joints.weight[k]
    at += HOLDERS - 1
    a = state.particle_position[state.joints.particle[at + 1]]
    volume6, largest = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32)
    for turn in range(2):  # first compute the size of the shift, then apply it
        part = ti.min(1.0, MOST_SHIFT / ti.max(largest, 1e-30))
        for i in range(3):
            b = state.particle_position[state.joints.particle[at + 2 + i]] - a
            c = state.particle_position[state.joints.particle[at + 2 + (i + 1) % 3]] - a
            d = state.particle_position[state.joints.particle[at + 2 + (i + 2) % 3]] - a
            across = c.cross(d)
            volume6 = b.dot(across)
            shift = gap.dot(across) / volume6  # change of the barycentric coordinate of this corner
            if turn == 0:
                largest = ti.max(largest, 3.0 * ti.abs(shift))
            elif volume6 != 0.0 and largest < 1e6:
                state.joints.share[at + 2 + i] = state.joints.share[at + 2 + i] - part * shift
                state.joints.share[at + 1] = state.joints.share[at + 1] + part * shift
    axis = _sliding_axis(state, j)
    gap -= gap.dot(axis) * axis
    rate = ti.min(CLOSE, 0.5 / h, draw_speed / ti.max(gap.norm(), 1e-30))
    state.joints.approach[r] = -rate * gap
    state.joints.row_impulse[r] = ti.Vector.zero(ti.f32, 3)


@ti.func
def _side_is_rigid(state: ti.template(), r, side):
    """Return the body of a row's side (0: held, 1: holding), and 1 if it is rigid, else 0."""
    body = state.particle_body[state.joints.particle[r * ENDS + side * HOLDERS]]
    return body, int(is_rigid(state, body))


@ti.real_func
def _solve_rigid_row(state: ti.template(), j: ti.i32, r: ti.i32):
    """Do the same as `_solve_row` if a body of the joint is rigid.

    The impulse on a rigid body acts at the held point, so that the joint conserves angular momentum.
    """
    x, axis = _held_point(state, r), _sliding_axis(state, j)
    wanted, mobility = state.joints.approach[r], ti.Matrix.zero(ti.f32, 3, 3)
    for side in range(2):
        sign = 1.0 - 2.0 * side
        body, is_stiff = _side_is_rigid(state, r, side)
        if is_stiff == 1:
            wanted -= sign * rigid_velocity(state, body, x)
            mobility += rigid_mobility(state, body, x)
        else:
            for k in range(r * ENDS + side * HOLDERS, r * ENDS + (side + 1) * HOLDERS):
                p, share = state.joints.particle[k], state.joints.share[k]
                wanted -= share * velocity(state, p)
                for i in ti.static(range(3)):
                    mobility[i, i] += share * share * inv_mass_of(state, p)
    # Along the axis, the row exerts no impulse.
    free = axis.outer_product(axis)
    across = ti.Matrix.identity(ti.f32, 3) - free
    size = mobility.trace()
    impulse = (across @ mobility @ across + ti.max(size, 1e-30) * free).inverse() @ (across @ wanted)
    if size > 0.0 and is_finite(impulse) == 1:
        for side in range(2):
            sign = 1.0 - 2.0 * side
            body, is_stiff = _side_is_rigid(state, r, side)
            if is_stiff == 1:
                push_rigid(state, body, x, sign * impulse)
            else:
                _push_particles(state, r * ENDS + side * HOLDERS, r * ENDS + (side + 1) * HOLDERS, impulse)
        state.joints.row_impulse[r] = state.joints.row_impulse[r] + impulse
        state.joints.impulse[j] = state.joints.impulse[j] + impulse


@ti.func
def _push_particles(state: ti.template(), first, end, impulse):
    """Apply the shares of the ends `first` to `end` in an impulse of their row [N s]."""
    for k in range(first, end):
        p, part = state.joints.particle[k], state.joints.share[k] * impulse
        state.particle_velocity[p] = state.particle_velocity[p] + inv_mass_of(state, p) * part
        feels = state.body_drives[state.particle_body[p]] & FEELS_REACTION
        if state.particle_inv_mass[p] == 0.0 and feels != 0:
            state.particle_reaction[p] = state.particle_reaction[p] + part


@ti.func
def _solve_row(state: ti.template(), j, r):
    """Apply the impulse that gives the gap of a row its target rate of change."""
    at = r * ENDS
    total, wanted = ti.cast(0.0, ti.f32), state.joints.approach[r]
    for k in range(at, at + ENDS):
        p, share = state.joints.particle[k], state.joints.share[k]
        total += share * share * inv_mass_of(state, p)
        wanted -= share * velocity(state, p)
    impulse = wanted / ti.max(total, 1e-30)
    if total > 0.0 and is_finite(impulse) == 1:
        _push_particles(state, at, at + ENDS, impulse)
        state.joints.row_impulse[r] = state.joints.row_impulse[r] + impulse
        state.joints.impulse[j] = state.joints.impulse[j] + impulse


@ti.func
def _has_rigid(state: ti.template(), r):
    """1 if a body of a row is rigid."""
    has_rigid = 0
    if ti.static(state.capacity.contact.rigid):
        for side in range(2):
            has_rigid |= _side_is_rigid(state, r, side)[1]
    return has_rigid


@ti.func
def _velocity_of_end(state: ti.template(), k):
    """Return the velocity of the particle at an end of a row [m/s]."""
    p = state.joints.particle[k]
    v = state.particle_velocity[p]
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, state.particle_body[p]):
            v = rigid_velocity(state, state.particle_body[p], state.particle_position[p])
    return v


@ti.func
def _turned(i, first, last, back):
    """Return index i for a forward sweep, or the mirrored index for a backward sweep."""
    return ti.select(back == 1, first + last - 1 - i, i)


@ti.real_func
def solve_joints(
    state: ti.template(), island: ti.i32, h: ti.f32, is_first: ti.i32, common: ti.math.vec3
) -> ti.math.vec2:
    """Solve the joints of an island for a substep of `h` [s], after the kicks of all its bodies.

    Args:
        is_first: 1 in the first substep of a step.
        common: mean velocity of the bodies of the island [m/s].
    Returns: highest speed of the joints' particles [m/s], absolute and relative to `common`.
    """
    first, last = state.islands.first[island], state.islands.first[island + 1]
    is_joined, member = 0, first
    while member < last:
        is_joined = is_joined | (state.body_drives[state.islands.body[member]] & JOINED)
        member = row_behind(member)
    highest, highest_beside = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32)
    sweeps = ti.select(is_joined != 0, SWEEPS + 2, 0)
    for sweep in range(sweeps):
        back = sweep % 2
        for i in range(first, last):
            body = state.islands.body[_turned(i, first, last, back)]
            for step in range(ti.select(state.body_drives[body] & JOINED != 0, MOST_JOINTS, 0)):
                j = _turned(step, 0, MOST_JOINTS, back)
                ends = state.joints.bodies[j]
                # Ignore joints to a failed body, so that this body cannot damage other bodies.
                other = ti.max(ends[1] - 1, 0)
                is_exploding = state.islands.is_exploding[body] + state.islands.is_exploding[other]
                is_off = state.body_status[other] > ABSENT
                if ends[0] == body + 1 and is_exploding == 0 and not is_off:
                    if sweep == 0 and is_first == 1:
                        state.joints.impulse[j] = ti.Vector.zero(ti.f32, 3)
                    rows = state.joints.rows[j]
                    row = rows[0]
                    while row < rows[1]:
                        r = _turned(row, rows[0], rows[1], back)
                        if sweep == 0:
                            _open_row(state, j, r, h, state.joints.draw_speed[j])
                        elif sweep <= SWEEPS:
                            if _has_rigid(state, r) == 1:
                                if ti.static(state.capacity.contact.rigid):
                                    _solve_rigid_row(state, j, r)
                            else:
                                _solve_row(state, j, r)
                        else:
                            for k in range(r * ENDS, (r + 1) * ENDS):
                                v = _velocity_of_end(state, k)
                                highest = ti.max(highest, v.dot(v))
                                highest_beside = ti.max(highest_beside, (v - common).dot(v - common))
                        row = row_behind(row)
    return ti.math.vec2(ti.sqrt(highest), ti.sqrt(highest_beside))


@ti.func
def are_joined(state: ti.template(), a, b):
    """Return 1 if a joint connects the bodies a and b, else 0."""
    found = 0
    if state.body_drives[a] & state.body_drives[b] & JOINED != 0:
        for j in range(MOST_JOINTS):
            ends = state.joints.bodies[j]
            if ti.min(ends[0], ends[1]) == ti.min(a, b) + 1 and ti.max(ends[0], ends[1]) == ti.max(a, b) + 1:
                found = 1
    return found


@ti.func
def mark_held(state: ti.template(), is_held):
    """Mark (1) or unmark (0) the particles that joints hold.

    A particle of a rigid body stands for all of its points: contact then ignores the whole pair of bodies.
    """
    for j in range(MOST_JOINTS):
        if state.joints.bodies[j][0] > 0:
            r = state.joints.rows[j][0]
            while r < state.joints.rows[j][1]:
                state.joints.is_held[state.joints.particle[r * ENDS]] = is_held
                r = row_behind(r)


@ti.kernel
def forget_held(state: ti.template()):
    """Unmark all held particles, before joints change. Each step marks them again."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        mark_held(state, 0)


@ti.kernel
def write_joint(
    state: ti.template(),
    j: ti.i32,
    body: ti.i32,
    other: ti.i32,
    first: ti.i32,
    draw_speed: ti.f32,
    axis: ti.types.ndarray(dtype=ti.f32, ndim=1),
    particles: ti.types.ndarray(dtype=ti.i32, ndim=2),
    weights: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Write a new joint.

    Args:
        j: index of the joint.
        body, other: body whose particles are held, and body that holds them.
        first: first row of the joint, after the rows of all other joints.
        draw_speed: largest closing speed of a gap [m/s].
        axis: direction in which the points can slide, (3,), see `JointFields`.
        particles: four particles of `body` and four of `other` in each row, (n, 8).
        weights: weights of these particles, (n, 8): four that sum to 1, and four that sum to -1.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        state.joints.bodies[j] = ti.Vector([body + 1, other + 1])
        state.joints.rows[j] = ti.Vector([first, first + particles.shape[0]])
        state.joints.draw_speed[j] = draw_speed
        state.joints.axis[j] = ti.Vector([axis[0], axis[1], axis[2]])
        state.joints.break_force[j] = 0.0
        state.joints.impulse[j] = ti.Vector.zero(ti.f32, 3)
        i = 0
        while i < particles.shape[0]:
            state.joints.row_impulse[first + i] = ti.Vector.zero(ti.f32, 3)
            for k in range(ENDS):
                state.joints.particle[(first + i) * ENDS + k] = particles[i, k]
                state.joints.weight[(first + i) * ENDS + k] = weights[i, k]
                state.joints.share[(first + i) * ENDS + k] = weights[i, k]
            i = row_behind(i)
        state.body_drives[body] = state.body_drives[body] | JOINED
        state.body_drives[other] = state.body_drives[other] | JOINED


@ti.kernel
def end_joint(state: ti.template(), j: ti.i32):
    """Remove a joint, and move later rows forward to fill the gap."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        mark_held(state, 0)
        ends, rows = state.joints.bodies[j], state.joints.rows[j]
        count, used = rows[1] - rows[0], rows[1]
        state.joints.bodies[j] = ti.Vector([0, 0])
        for i in ti.static(range(2)):
            state.body_drives[ends[i] - 1] = state.body_drives[ends[i] - 1] & ~JOINED
        for each in range(MOST_JOINTS):
            here = state.joints.bodies[each]
            if here[0] > 0:
                used = ti.max(used, state.joints.rows[each][1])
                if state.joints.rows[each][0] >= rows[1]:
                    state.joints.rows[each] = state.joints.rows[each] - count
                for i in ti.static(range(2)):
                    state.body_drives[here[i] - 1] = state.body_drives[here[i] - 1] | JOINED
        r, k = rows[1], rows[1] * ENDS
        while r < used:
            state.joints.row_impulse[r - count] = state.joints.row_impulse[r]
            r = row_behind(r)
        while k < used * ENDS:
            state.joints.particle[k - count * ENDS] = state.joints.particle[k]
            state.joints.weight[k - count * ENDS] = state.joints.weight[k]
            state.joints.share[k - count * ENDS] = state.joints.share[k]
            k = row_behind(k)


@ti.kernel
def read_joint_impulses(state: ti.template(), impulses: ti.types.ndarray(dtype=ti.f32, ndim=2)):
    """Write the impulse of each joint on its first body in the last step, (MOST_JOINTS, 3) [N s]."""
    ti.loop_config(serialize=True)
    for j in range(MOST_JOINTS):
        for k in ti.static(range(3)):
            impulses[j, k] = state.joints.impulse[j][k]


@ti.kernel
def write_break_force(state: ti.template(), j: ti.i32, force: ti.f32):
    """Set the force at which a joint breaks [N]; 0 for never."""
    state.joints.break_force[j] = force


@ti.kernel
def add_joint_forces(
    state: ti.template(), body: ti.i32, h: ti.f32, forces: ti.types.ndarray(dtype=ti.f32, ndim=2)
):
    """Add the forces of joints on one body's particles in the last substep, of `h` [s], to `forces` [N]."""
    ti.loop_config(serialize=True)
    for j in range(MOST_JOINTS):
        ends = state.joints.bodies[j]
        if ends[0] == body + 1 or ends[1] == body + 1:
            k = state.joints.rows[j][0] * ENDS
            while k < state.joints.rows[j][1] * ENDS:
                p = state.joints.particle[k]
                if state.particle_body[p] == body:
                    force = state.joints.share[k] / h * state.joints.row_impulse[k // ENDS]
                    for i in ti.static(range(3)):
                        row = p - state.body_particles[body][0]
                        forces[row, i] = forces[row, i] + force[i]
                k = row_behind(k)
