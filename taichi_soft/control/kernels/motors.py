"""Motors: their fields, and functions that rotate or push a part of a body.

A motor moves its particles by a pattern d. The pattern is d = a x (x - c) [m] for a rotation about the axis a
through c, and d = a for a push along the axis. The motor uses the velocities v after the forces of a substep
of h seconds:

    inertia  I = sum m d.d        speed  w = sum m d.v / I
    impulse  J = I (wanted - w), no larger than limit h
    v += J / I d

The pattern is a rigid motion, so a motor deforms only the region between its particles and the rest of the
body. After the forces of the substep, the particles have the target speed, unless the limit is too low. An
axis that rotates with the particles is fixed in the rest shape.

Groups of fields: writes motors.
"""

from taichi_soft.bodies.kernels.origins import enter_local, leave_local
from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.core.field_table import BODY, FINITE, PARTICLE, Below, FieldGroup, declare
from taichi_soft.core.math.eigen import symmetric_eigen
from taichi_soft.core.math.rigid_fit import fitting_motion, kept
from taichi_soft.core.math.rows import row_at, row_behind
from taichi_soft.core.math.svd import nearest_rotation
from taichi_soft.core.runtime import ti

MOST_MOTORS, MOTOR_ROWS = 64, 16384
"""MOST_MOTORS is the largest number of motors of a world. MOTOR_ROWS is the largest number of particles
that all motors drive together."""

ALL_MOTORS, USED_MOTORS, MOTOR_PARTICLES = "motors", "used motors", "particles of motors"
"""Groups of rows in a snapshot: all motors, the motors up to the last one in use, and the particles of all
motors."""

MOST_CHANGE = 0.25
"""Largest change of a particle's velocity by a motor in one substep, as a fraction of the speed of sound
in the body. Larger changes would separate the driven particles from the rest of the body."""


@ti.dataclass
class MotorRow:
    """Data of one motor."""

    body: ti.i32  # index plus 1, 0 if unused
    first: ti.i32  # first row in `MotorFields.particle`
    end: ti.i32  # row after the motor's last row
    turns: ti.i32  # 1: rotates particles about the axis, 0: pushes particles along the axis
    is_fixed: ti.i32  # 1: the axis keeps its direction, 0: the axis rotates with the particles
    has_point: ti.i32  # 1: the axis passes through `point`, 0: it passes through the particles' centre
    axis: ti.math.vec3  # unit vector; in world axes if `is_fixed`, else in axes of the rest shape
    point: ti.math.vec3  # point on the axis [m]
    speed: ti.f32  # target speed [rad/s] or [m/s]
    limit: ti.f32  # largest torque [N m] or force [N]


class MotorFields(FieldGroup):
    """All motors of a world."""

    owner = "control"
    motor = declare(
        MOST_MOTORS,
        MotorRow,
        start=0,
        native_keep=ALL_MOTORS,
        below={"body": Below(BODY, 1)},
        most=FINITE,
        native=True,
    )
    particle = declare(MOTOR_ROWS, ti.i32, native_keep=MOTOR_PARTICLES, below=Below(PARTICLE), native=True)
    is_driven = declare(BODY, ti.i32, start=0, native=True)  # 1 if a motor drives the body
    # Impulse in the last step. A motor that rotates particles has an angular impulse [N m s].
    impulse = declare(MOST_MOTORS, ti.f32, unit="N s", start=0, keep=USED_MOTORS, most=FINITE, native=True)


@ti.func
def _axis_now(state: ti.template(), motor):
    """Return a point on the axis of a motor at the current time [m], and the current direction of the axis.

    An axis that rotates with the particles follows the rotation nearest to sum m x r^T, where x and r are the
    current positions and the rest positions of the particles, relative to their centre.
    """
    first = state.motors.particle[motor.first]
    x0, r0 = state.particle_position[first], state.rest_position[first]
    mass, now, rest = x0.x * 0.0, x0 * 0.0, x0 * 0.0
    a, b, c, size = x0 * 0.0, x0 * 0.0, x0 * 0.0, x0.x * 0.0
    row = motor.first
    while row < motor.end:
        p = state.motors.particle[row]
        m = state.particle_mass[p]
        x, r = state.particle_position[p] - x0, state.rest_position[p] - r0
        mass += m
        now, rest = now + m * x, rest + m * r
        a, b, c, size = a + m * r.x * x, b + m * r.y * x, c + m * r.z * x, size + m * r.dot(r)
        row = row_behind(row)
    point, axis = motor.point - state.body_origin[motor.body - 1], motor.axis
    if motor.has_point == 0:
        point = x0 + now / mass
    if motor.is_fixed == 0:
        size = ti.max(size, 1e-30)
        a, b, c = a - rest.x / mass * now, b - rest.y / mass * now, c - rest.z / mass * now
        rows = nearest_rotation((a / size, b / size, c / size))
        axis = ti.Vector([rows[0].dot(motor.axis), rows[1].dot(motor.axis), rows[2].dot(motor.axis)])
    return point, axis


@ti.func
def _pattern(state: ti.template(), motor, p, point, axis):
    return ti.select(motor.turns == 1, axis.cross(state.particle_position[p] - point), axis)


@ti.func
def _run_motor(state: ti.template(), motor, h, kick):
    """Apply a motor to the velocities during `h` [s]. Return its impulse [N m s] or [N s]."""
    gravity, sound_speed = gravity_on(state, motor.body - 1), state.body_sound_speed[motor.body - 1]
    point, axis = _axis_now(state, motor)
    inertia, momentum, longest = point.x * 0.0, point.x * 0.0, point.x * 0.0
    row = motor.first
    while row < motor.end:
        p = state.motors.particle[row]
        inv_mass = state.particle_inv_mass[p]
        if inv_mass > 0.0:
            d = _pattern(state, motor, p, point, axis)
            velocity = state.particle_velocity[p]
            velocity += ti.select(kick > 0.0, kick, h) * (inv_mass * state.particle_force[p].xyz + gravity)
            inertia += state.particle_mass[p] * d.dot(d)
            momentum += state.particle_mass[p] * d.dot(velocity)
            longest = ti.max(longest, d.dot(d))
        row = row_behind(row)
    impulse = h * 0.0  # stays 0 if an infinite point makes the inertia NaN
    if inertia > 0.0:
        speed = momentum / inertia
        most = ti.min(motor.limit * h / inertia, MOST_CHANGE * sound_speed / ti.sqrt(longest))
        change = ti.max(-most, ti.min(motor.speed - speed, most))
        pushed = inertia * change
        # Skip larger values, which mean that the body is diverging.
        if ti.abs(speed) < 1e18 and ti.abs(change) < 1e18 and ti.abs(pushed) < 1e18:
            row = motor.first
            while row < motor.end:
                p = state.motors.particle[row]
                if state.particle_inv_mass[p] > 0.0:
                    d = _pattern(state, motor, p, point, axis)
                    state.particle_velocity[p] = state.particle_velocity[p] + change * d
                row = row_behind(row)
            impulse = pushed
    return impulse


@ti.real_func
def run_motors(state: ti.template(), body: ti.i32, h: ti.f32, kick: ti.f32, is_first: ti.i32):
    """Apply the motors of one body for a substep of `h` [s].

    The motors use the velocities after a kick of `kick` [s], so that they also balance the forces of this
    substep. If `kick` is 0, the forces are computed later, and the motors balance only gravity.

    Args:
        is_first: 1 in the first substep of a step.
    """
    if state.motors.is_driven[body] == 1:
        for number in range(MOST_MOTORS):
            if state.motors.motor[number].body == body + 1:
                motor = state.motors.motor[number]
                before = ti.select(is_first == 1, 0.0, state.motors.impulse[number])
                state.motors.impulse[number] = before + _run_motor(state, motor, h, kick)
                if motor.speed != 0.0 and motor.limit > 0.0 and state.body_calm_time[body] != 0.0:
                    state.body_calm_time[body] = 0.0  # keeps a body awake that a motor starts slowly


@ti.kernel
def write_motors(
    state: ti.template(),
    rows: ti.types.ndarray(dtype=ti.i32, ndim=2),
    numbers: ti.types.ndarray(dtype=ti.f32, ndim=2),
    particles: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Replace all motors.

    Args:
        rows: index, body, first row, end row, `turns`, `is_fixed` and `has_point` of each motor, (k, 7).
        numbers: axis, point [m], target speed and limit of each motor, (k, 8).
        particles: particles of all motors, concatenated.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        for body in range(state.motors.is_driven.shape[0]):
            state.motors.is_driven[body] = 0
        for number in range(MOST_MOTORS):
            state.motors.motor[number].body = 0
        k = 0
        while k < rows.shape[0]:
            state.motors.motor[rows[k, 0]] = MotorRow(
                body=rows[k, 1] + 1,
                first=rows[k, 2],
                end=rows[k, 3],
                turns=rows[k, 4],
                is_fixed=rows[k, 5],
                has_point=rows[k, 6],
                axis=ti.Vector([numbers[k, 0], numbers[k, 1], numbers[k, 2]]),
                point=ti.Vector([numbers[k, 3], numbers[k, 4], numbers[k, 5]]),
                speed=numbers[k, 6],
                limit=numbers[k, 7],
            )
            state.motors.is_driven[rows[k, 1]] = 1
            k = row_behind(k)
        row = 0
        while row < particles.shape[0]:
            state.motors.particle[row] = particles[row]
            row = row_behind(row)


@ti.kernel
def write_drive(state: ti.template(), number: ti.i32, speed: ti.f32, limit: ti.f32):
    """Write the target speed and the limit of a motor."""
    state.motors.motor[number].speed = speed
    state.motors.motor[number].limit = limit


@ti.kernel
def read_speed(state: ti.template(), number: ti.i32) -> ti.f32:
    """Return the speed of a motor's particles about its axis [rad/s] or along it [m/s]."""
    inertia, momentum = 0.0, 0.0
    ti.loop_config(serialize=True)
    for _ in range(1):
        motor = state.motors.motor[number]
        enter_local(state, motor.body - 1, state.body_origin[motor.body - 1])
        point, axis = _axis_now(state, motor)
        row = motor.first
        while row < motor.end:
            p = state.motors.particle[row]
            d = _pattern(state, motor, p, point, axis)
            inertia += state.particle_mass[p] * d.dot(d)
            momentum += state.particle_mass[p] * d.dot(state.particle_velocity[p])
            row = row_behind(row)
        leave_local(state, motor.body - 1)
    return momentum / ti.max(inertia, 1e-30)


@ti.kernel
def forget_impulse(state: ti.template(), number: ti.i32):
    """Clear the impulse of a motor before its index is reused."""
    state.motors.impulse[number] = 0.0


@ti.kernel
def find_rest_axis(
    rest: ti.types.ndarray(dtype=ti.f64, ndim=2),
    now: ti.types.ndarray(dtype=ti.f64, ndim=2),
    weights: ti.types.ndarray(dtype=ti.f64, ndim=1),
    axis: ti.types.ndarray(dtype=ti.f64, ndim=1),
    found: ti.types.ndarray(dtype=ti.f64, ndim=1),
):
    """Transform an axis from the current shape of the driven particles to their rest shape.

    Args:
        rest, now: rest and current positions of the particles, (n, 3) [m].
        weights: masses of the particles, scaled to the sum 1.
        axis: current direction, (3,).
        found: (4,), receives the direction at rest, and the width of the driven part divided by its length.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        center, a = ti.Vector.zero(ti.f64, 3), ti.Vector.zero(ti.f64, 3)
        b, c = ti.Vector.zero(ti.f64, 3), ti.Vector.zero(ti.f64, 3)
        for i in range(weights.shape[0]):
            center += weights[i] * row_at(rest, i, 0)
        for i in range(weights.shape[0]):
            offset = row_at(rest, i, 0) - center
            part = weights[i] * offset
            a, b, c = a + part.x * offset, b + part.y * offset, c + part.z * offset
        variances, _axes = symmetric_eigen((a, b, c))
        rotation, _translation = fitting_motion(rest, now, 0, weights)
        at_rest = kept(rotation.transpose() @ ti.Vector([axis[0], axis[1], axis[2]]))
        for k in ti.static(range(3)):
            found[k] = at_rest[k]
        found[3] = ti.sqrt(ti.max(variances.y, 0.0) / ti.max(variances.x, 1e-30))
