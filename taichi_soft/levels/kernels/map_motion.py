"""Kernel that maps the motion of a body to another level of detail, in 64-bit floats."""

from taichi_soft.core.math.rigid_fit import fitting_motion, kept
from taichi_soft.core.math.rows import row_at
from taichi_soft.core.runtime import ti

POSITION, VELOCITY, EARLIER_POSITION, EARLIER_VELOCITY = 0, 3, 6, 9
INV_MASS, MASS, AIM, TARGET, PUSH, REACTION = 12, 15, 16, 17, 20, 23
"""First column of each quantity in a row of `read_motion`. Columns before `INV_MASS` are interpolated."""


@ti.func
def _put(rows: ti.template(), i, column, vector):
    for k in ti.static(range(3)):
        rows[i, column + k] = vector[k]


@ti.func
def _center(rows: ti.template(), x):
    """Return the centre of mass [m] of the positions in the three columns from `x` on."""
    mass, moment = ti.cast(0.0, ti.f64), ti.Vector.zero(ti.f64, 3)
    for i in range(rows.shape[0]):
        mass += rows[i, MASS]
        moment += rows[i, MASS] * row_at(rows, i, x)
    return moment / mass


@ti.func
def _momenta(rows: ti.template(), x, v, center):
    """Return momentum [kg m/s] and angular momentum about `center` [kg m^2/s].

    Args: x, v: first columns of the positions and of the velocities.
    """
    momentum, angular_momentum = ti.Vector.zero(ti.f64, 3), ti.Vector.zero(ti.f64, 3)
    for i in range(rows.shape[0]):
        part = rows[i, MASS] * row_at(rows, i, v)
        momentum += part
        angular_momentum += (row_at(rows, i, x) - center).cross(part)
    return momentum, angular_momentum


@ti.func
def _rigid(rows: ti.template(), x, momentum, angular_momentum):
    """Return the rigid motion that has this momentum, and this angular momentum about the centre of mass.

    If the arguments are a force and a torque instead, the results are the accelerations of a rigid motion.

    Returns: centre of mass [m]; velocity of the centre [m/s]; angular velocity [rad/s].
    """
    center = _center(rows, x)
    mass, inertia = ti.cast(0.0, ti.f64), ti.Matrix.zero(ti.f64, 3, 3)
    for i in range(rows.shape[0]):
        arm = row_at(rows, i, x) - center
        mass += rows[i, MASS]
        inertia -= (rows[i, MASS] * arm).outer_product(arm)
    size = inertia[0, 0] + inertia[1, 1] + inertia[2, 2]
    size += 1e-9 * size  # keeps the inertia invertible if all particles lie on one line
    for k in ti.static(range(3)):
        inertia[k, k] -= size
    a = ti.Vector([inertia[0, k] for k in ti.static(range(3))])
    b = ti.Vector([inertia[1, k] for k in ti.static(range(3))])
    c = ti.Vector([inertia[2, k] for k in ti.static(range(3))])
    across = b.cross(c)  # the inertia is symmetric, so its rows are its columns
    spin = ti.Vector.zero(ti.f64, 3)
    spin.x = across.dot(angular_momentum)
    spin.y, spin.z = c.cross(a).dot(angular_momentum), a.cross(b).dot(angular_momentum)
    spin /= a.dot(across)
    return center, momentum / mass, spin


@ti.func
def _preserve_momentum(before: ti.template(), after: ti.template(), x, v):
    """Give the motion of `after` the centre of mass, momentum and angular momentum of `before`."""
    center = _center(before, x)
    shift = center - _center(after, x)
    for i in range(after.shape[0]):
        _put(after, i, x, row_at(after, i, x) + shift)
    momentum, angular_momentum = _momenta(before, x, v, center)
    present, angular_present = _momenta(after, x, v, center)
    middle, drift, spin = _rigid(after, x, momentum - present, angular_momentum - angular_present)
    for i in range(after.shape[0]):
        _put(after, i, v, row_at(after, i, v) + drift + spin.cross(row_at(after, i, x) - middle))


@ti.func
def _pin(
    before: ti.template(),
    after: ti.template(),
    rest_before: ti.template(),
    rest_after: ti.template(),
    weights: ti.template(),
    nearest: ti.template(),
):
    """Pin vertices of the new level, with the state of the nearest pinned vertices of the old level.

    The position of a pinned vertex follows from the rigid motion that fits the old pinned vertices best. The
    deviation of the nearest old vertex from this motion is added. The arrangement of the pinned vertices
    therefore does not drift over repeated changes of level.
    """
    for x in ti.static((POSITION, EARLIER_POSITION)):
        rotation, translation = fitting_motion(rest_before, before, x, weights)
        for k in ti.static(range(3)):
            row = kept(ti.Vector([rotation[k, 0], rotation[k, 1], rotation[k, 2]]))
            rotation[k, 0], rotation[k, 1], rotation[k, 2] = row.x, row.y, row.z
        translation = kept(translation)
        for i in range(after.shape[0]):
            if nearest[i] >= 0:
                old = rotation @ row_at(rest_before, nearest[i], 0) + translation
                deviation = row_at(before, nearest[i], x) - old
                _put(after, i, x, rotation @ row_at(rest_after, i, 0) + translation + deviation)
    for i in range(after.shape[0]):
        source = nearest[i]
        if source >= 0:
            after[i, INV_MASS], after[i, AIM] = 0.0, before[source, AIM]
            _put(after, i, VELOCITY, row_at(before, source, VELOCITY))
            moved = row_at(after, i, POSITION) - row_at(before, source, POSITION)
            _put(after, i, TARGET, row_at(before, source, TARGET) + moved)


@ti.func
def _map_pushes(before: ti.template(), after: ti.template()):
    """Distribute the total external force and torque over the particles of the new level.

    The resulting forces accelerate the new particles as a rigid body.
    """
    center = _center(before, POSITION)
    force, torque = ti.Vector.zero(ti.f64, 3), ti.Vector.zero(ti.f64, 3)
    for i in range(before.shape[0]):
        push = row_at(before, i, PUSH)
        force += push
        torque += (row_at(before, i, POSITION) - center).cross(push)
    middle, drift, spin = _rigid(after, POSITION, force, torque)
    for i in range(after.shape[0]):
        acceleration = drift + spin.cross(row_at(after, i, POSITION) - middle)
        _put(after, i, PUSH, after[i, MASS] * acceleration)


@ti.kernel
def map_motion(
    before: ti.types.ndarray(dtype=ti.f64, ndim=2),
    sources: ti.types.ndarray(dtype=ti.i32, ndim=1),
    begins: ti.types.ndarray(dtype=ti.i32, ndim=1),
    shares: ti.types.ndarray(dtype=ti.f64, ndim=1),
    masses: ti.types.ndarray(dtype=ti.f64, ndim=1),
    rest_before: ti.types.ndarray(dtype=ti.f64, ndim=2),
    rest_after: ti.types.ndarray(dtype=ti.f64, ndim=2),
    weights: ti.types.ndarray(dtype=ti.f64, ndim=1),
    nearest: ti.types.ndarray(dtype=ti.i32, ndim=1),
    after: ti.types.ndarray(dtype=ti.f64, ndim=2),
):
    """Map rows of `read_motion` (n, 26) to the vertices of another level, (m, 26).

    Args:
        sources, begins, shares: see `Passage.rows`.
        masses: masses of the new level's vertices, (m,) [kg].
        rest_before, rest_after: positions at rest, (n, 3) and (m, 3) [m].
        weights: weights of the old level's pinned vertices, with sum 1; 0 for other vertices, (n,).
        nearest: nearest pinned vertex of the old level for each vertex that will be pinned, else -1, (m,).
        after: receives the rows. The columns of touches and reactions become 0.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        is_held, count = 0, after.shape[0]
        for i in range(count):
            end = sources.shape[0]
            if i + 1 < count:
                end = begins[i + 1]
            for column in range(after.shape[1]):
                after[i, column] = 0.0
            for e in range(begins[i], end):
                for column in range(INV_MASS):
                    after[i, column] += before[sources[e], column] * shares[e]
            after[i, MASS], after[i, INV_MASS] = masses[i], 1.0 / masses[i]
            is_held = is_held | int(nearest[i] >= 0)
        if is_held == 1:
            _pin(before, after, rest_before, rest_after, weights, nearest)
        else:  # the momentum of a held body is not conserved
            _preserve_momentum(before, after, POSITION, VELOCITY)
            _preserve_momentum(before, after, EARLIER_POSITION, EARLIER_VELOCITY)
        _map_pushes(before, after)
