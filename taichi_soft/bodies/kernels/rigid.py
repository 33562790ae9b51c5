"""Rigid bodies: their motion from that of their particles, impulses on them, and their drift.

The angular momentum of a free body is constant. With the inertia I(q) of the rotation q, the angular velocity
I(q)^-1 L changes while the body turns, so that a body tumbles about its middle axis (Euler's equations). The
drift uses the angular velocity in the middle of the substep.

Groups of fields: writes rigid.
"""

from taichi_soft.bodies.status import ACTIVE
from taichi_soft.core.math.quaternion import matrix_of, quaternion_of_axes, spun
from taichi_soft.core.runtime import ti


@ti.func
def is_rigid(state: ti.template(), body):
    """True if a body is rigid."""
    rigid = False
    if ti.static(state.capacity.contact.rigid):
        rigid = state.rigid.radii[body].x > 0.0
    return rigid


@ti.func
def _corner(state: ti.template(), body, k: ti.template()):
    """Return the position of corner `k` in the frame of the principal axes [m]."""
    a, b, c = state.rigid.radii[body]
    x = a if ti.static(k < 2) else -a
    y = b if ti.static(k % 2 == 0) else -b
    z = c if ti.static(k == 0 or k == 3) else -c
    return ti.Vector([x, y, z])


@ti.func
def _place_corner(state: ti.template(), body, k: ti.template()):
    """Return the position of corner `k` in the pose of a body [m]."""
    return state.rigid.center[body] + matrix_of(state.rigid.rotation[body]) @ _corner(state, body, k)


@ti.func
def _place_corners(state: ti.template(), body):
    for k in ti.static(range(4)):
        state.particle_position[state.rigid.corners[body][k]] = _place_corner(state, body, k)


@ti.func
def _moments(state: ti.template(), body):
    """Return the principal moments of inertia of a body, divided by its mass, (3,) [m^2]."""
    r = state.rigid.radii[body]
    return ti.Vector([r.y * r.y + r.z * r.z, r.x * r.x + r.z * r.z, r.x * r.x + r.y * r.y])


@ti.func
def _spin_of(state: ti.template(), body, rotation, angular):
    """Return the angular velocity [rad/s] of a body with a rotation and an angular momentum per mass."""
    axes = matrix_of(rotation)
    return axes @ ((axes.transpose() @ angular) / _moments(state, body))


@ti.func
def _gather_angular(state: ti.template(), body, velocity):
    """Return the angular momentum of a body's particles about its centre, divided by its mass [m^2/s].

    Args: velocity: velocity of the centre [m/s].
    """
    axes, angular = matrix_of(state.rigid.rotation[body]), ti.Vector.zero(ti.f32, 3)
    for k in ti.static(range(4)):
        own = state.particle_velocity[state.rigid.corners[body][k]] - velocity
        angular += 0.25 * (axes @ _corner(state, body, k)).cross(own)
    return angular


@ti.func
def _measure_pose(state: ti.template(), body):
    """Compute the pose of a body from its particles."""
    center = ti.Vector.zero(ti.f32, 3)
    first = state.particle_position[state.rigid.corners[body][0]]
    for k in ti.static(range(4)):
        center += 0.25 * (state.particle_position[state.rigid.corners[body][k]] - first)
    center += first
    along, across = ti.Vector.zero(ti.f32, 3), ti.Vector.zero(ti.f32, 3)
    for k in ti.static(range(4)):
        arm = state.particle_position[state.rigid.corners[body][k]] - center
        along += arm if ti.static(k < 2) else -arm
        across += arm if ti.static(k % 2 == 0) else -arm
    x = along / ti.max(along.norm(), 1e-30)
    y = across - across.dot(x) * x
    y /= ti.max(y.norm(), 1e-30)
    state.rigid.center[body] = center
    state.rigid.rotation[body] = quaternion_of_axes(x, y, x.cross(y))


@ti.func
def has_own_pose(state: ti.template(), body):
    """Return 1 if the particles of a body are where its pose places them, 0 if something has moved them."""
    is_moved = 0
    for k in ti.static(range(4)):
        apart = state.particle_position[state.rigid.corners[body][k]] - _place_corner(state, body, k)
        is_moved |= int(not (ti.abs(apart).max() <= 0.0))  # true for NaN too
    return 1 - is_moved


@ti.func
def shift_pose(state: ti.template(), body, offset, has_pose):
    """Move the pose of a body by `offset` [m], and the particles to the pose if `has_pose` is 1."""
    moved = ti.cast(state.rigid.center[body], ti.f64) + ti.cast(offset, ti.f64)
    state.rigid.center[body] = ti.cast(moved, ti.f32)
    if has_pose == 1:
        _place_corners(state, body)


@ti.real_func
def begin_rigid(state: ti.template(), body: ti.i32):
    """Save the pose of a body before a step. If its particles were moved, compute the pose from them."""
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body):
            if has_own_pose(state, body) == 0:
                _measure_pose(state, body)
                state.rigid.residue[body] = ti.Vector.zero(ti.f32, 3)
            state.rigid.prev_center[body] = state.rigid.center[body]
            state.rigid.prev_rotation[body] = state.rigid.rotation[body]
            state.rigid.prev_residue[body] = state.rigid.residue[body]
            # These values remain if the body does not move in this step.
            state.rigid.velocity[body] = ti.Vector.zero(ti.f32, 3)
            state.rigid.spin[body] = ti.Vector.zero(ti.f32, 3)
            state.rigid.inv_mass[body] = 0.0
            state.rigid.inv_inertia[body] = ti.Matrix.zero(ti.f32, 3, 3)


@ti.func
def restore_rigid(state: ti.template(), body):
    """Restore the pose that a body had before the step."""
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body):
            state.rigid.center[body] = state.rigid.prev_center[body]
            state.rigid.rotation[body] = state.rigid.prev_rotation[body]
            state.rigid.residue[body] = state.rigid.prev_residue[body]


@ti.func
def _set_inertia(state: ti.template(), body, mass):
    """Store the inverse inertia of a body in its rotation."""
    axes, inverse = matrix_of(state.rigid.rotation[body]), ti.Matrix.zero(ti.f32, 3, 3)
    moments = mass * _moments(state, body)
    for k in ti.static(range(3)):
        axis = axes[:, k]
        inverse += axis.outer_product(axis) / moments[k]
    state.rigid.inv_inertia[body] = inverse


@ti.real_func
def gather_motion(state: ti.template(), body: ti.i32):
    """Compute the rigid motion with the momentum and angular momentum of a body's particles."""
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body) and state.body_status[body] == ACTIVE:
            corners, mass = state.rigid.corners[body], ti.cast(0.0, ti.f32)
            velocity, is_free = ti.Vector.zero(ti.f32, 3), 1
            for k in ti.static(range(4)):
                velocity += 0.25 * state.particle_velocity[corners[k]]
                mass += state.particle_mass[corners[k]]
                is_free &= int(state.particle_inv_mass[corners[k]] > 0.0)
            angular = _gather_angular(state, body, velocity) + state.rigid.residue[body]
            state.rigid.velocity[body] = velocity
            state.rigid.angular[body] = angular
            state.rigid.spin[body] = _spin_of(state, body, state.rigid.rotation[body], angular)
            state.rigid.inv_mass[body] = is_free / mass
            if is_free == 1:
                _set_inertia(state, body, mass)


@ti.func
def arm_of(state: ti.template(), body, x):
    """Return the vector from the centre of a rigid body to the point `x` [m]."""
    return x - state.rigid.center[body]


@ti.func
def rigid_velocity(state: ti.template(), body, x):
    """Return the velocity of a rigid body at the point `x` [m/s]."""
    return state.rigid.velocity[body] + state.rigid.spin[body].cross(arm_of(state, body, x))


@ti.func
def rigid_inv_mass(state: ti.template(), body, x, n):
    """Return the speed along the unit vector `n` that 1 N s along `n` at the point `x` causes [m/s]."""
    turn = arm_of(state, body, x).cross(n)
    return state.rigid.inv_mass[body] + turn.dot(state.rigid.inv_inertia[body] @ turn)


@ti.func
def rigid_mobility(state: ti.template(), body, x):
    """Return the matrix that maps an impulse at the point `x` to the change of velocity there [1/kg]."""
    r = arm_of(state, body, x)
    cross = ti.Matrix([[0.0, -r.z, r.y], [r.z, 0.0, -r.x], [-r.y, r.x, 0.0]])
    mobility = -(cross @ state.rigid.inv_inertia[body] @ cross)
    for i in ti.static(range(3)):
        mobility[i, i] += state.rigid.inv_mass[body]
    return mobility


@ti.func
def push_rigid(state: ti.template(), body, x, impulse):
    """Apply an impulse [N s] to a rigid body at the point `x`."""
    moment = arm_of(state, body, x).cross(impulse)
    state.rigid.velocity[body] = state.rigid.velocity[body] + state.rigid.inv_mass[body] * impulse
    state.rigid.angular[body] = state.rigid.angular[body] + state.rigid.inv_mass[body] * moment
    state.rigid.spin[body] = state.rigid.spin[body] + state.rigid.inv_inertia[body] @ moment


@ti.real_func
def shift_rigid(state: ti.template(), body: ti.i32, x: ti.math.vec3, impulse: ti.math.vec3):
    """Displace a rigid body as far as an `impulse` [N s] at the point `x` would move it in 1 s.

    Its momentum and its angular momentum stay the same.
    """
    if state.rigid.inv_mass[body] > 0.0:
        turn = state.rigid.inv_inertia[body] @ arm_of(state, body, x).cross(impulse)
        angular = state.rigid.angular[body]
        state.rigid.center[body] = state.rigid.center[body] + state.rigid.inv_mass[body] * impulse
        state.rigid.rotation[body] = spun(state.rigid.rotation[body], turn).normalized()
        state.rigid.spin[body] = _spin_of(state, body, state.rigid.rotation[body], angular)
        _set_inertia(state, body, 1.0 / state.rigid.inv_mass[body])
        _place_corners(state, body)


@ti.func
def scatter_motion(state: ti.template(), body):
    """Give the particles of a free rigid body the velocities of its motion."""
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body) and state.rigid.inv_mass[body] > 0.0:
            axes, center = matrix_of(state.rigid.rotation[body]), ti.Vector.zero(ti.f32, 3)
            for k in ti.static(range(4)):
                velocity = state.rigid.spin[body].cross(axes @ _corner(state, body, k))
                velocity += state.rigid.velocity[body]
                state.particle_velocity[state.rigid.corners[body][k]] = velocity
                center += 0.25 * velocity
            residue = state.rigid.angular[body] - _gather_angular(state, body, center)
            state.rigid.residue[body] = residue


@ti.real_func
def drift_rigid(state: ti.template(), body: ti.i32, h: ti.f32) -> ti.i32:
    """Move a free rigid body by its motion for `h` [s], and its particles with it.

    Returns: 1 if the body was moved; 0 if it is pinned, so that its particles must move one by one.
    """
    is_free = int(state.rigid.inv_mass[body] > 0.0)
    if is_free == 1:
        rotation, angular = state.rigid.rotation[body], state.rigid.angular[body]
        halfway = spun(rotation, 0.5 * h * state.rigid.spin[body])
        rotation = spun(rotation, h * _spin_of(state, body, halfway, angular)).normalized()
        spin = _spin_of(state, body, rotation, angular)
        state.rigid.center[body] = state.rigid.center[body] + h * state.rigid.velocity[body]
        state.rigid.rotation[body] = rotation
        _place_corners(state, body)
        state.rigid.spin[body] = spin
        scatter_motion(state, body)
    return is_free
