"""Positions about the origin of a body, which keep their precision far from the origin of the world.

Between steps, `particle_position` is in the world, rounded to float32: to 2 mm at 20 km. A body that is far
away therefore also has an origin: a point near it whose coordinates are multiples of `CELL`.
`particle_local` is the exact position relative to this origin. In a step, `particle_position` is this local
position, so forces, contact and motion have the precision that they have at the origin of the world. All
bodies of an island have the same origin, so only what comes from outside the island must be transformed:
colliders, grabs, motors with a point.

If something else changes `particle_position` between steps, its sum with the origin no longer matches
`particle_local`, and the new position counts.

The origin is zero near the origin of the world. There, nothing is transformed.

Groups of fields: reads hull.
"""

from taichi_soft.bodies.kernels.rigid import has_own_pose, is_rigid, shift_pose
from taichi_soft.bodies.status import TO_TARGET
from taichi_soft.core.constants import CELL, NEAR
from taichi_soft.core.runtime import ti


@ti.func
def origin_near(x, origin):
    """Return the origin for a body at `x` [m]: `origin`, or another one if `x` is too far from it.

    A body that stays within a cell keeps its origin, also if it rests on the border of a cell.
    """
    found = origin
    for i in ti.static(range(3)):
        if ti.abs(x[i] - origin[i]) > ti.select(origin[i] == 0.0, NEAR, CELL):
            cell = CELL * ti.floor(x[i] / CELL + 0.5)
            found[i] = ti.select(ti.abs(x[i]) <= NEAR - CELL, 0.0, cell)
    return found


@ti.func
def rounding_at(origin):
    """Return the largest rounding of a world coordinate near `origin` [m]; zero for the world's origin."""
    return 1.2e-7 * ti.abs(origin).max()


@ti.func
def residue_of(x, residue):
    """Return the rounding error of a position `x`, or zero where adding it, itself rounded, would change `x`.

    For a body whose origin is zero, `x` then counts alone.
    """
    return ti.select(x + residue == x, residue, 0.0)


@ti.func
def local_position(state: ti.template(), body, p):
    """Return the position of a particle relative to the origin of its body [m]."""
    x, origin = state.particle_position[p], state.body_origin[body]
    found = x - origin
    if (state.particle_local[p] + origin == x).all():
        found = state.particle_local[p]
    return found


@ti.func
def has_view(state: ti.template()):
    """Return 1 if drawn positions are relative to a point other than the origin of the world, else 0."""
    return int((state.view_origin[None] != 0.0).any())


@ti.func
def seen_position(state: ti.template(), p, alpha, is_relative):
    """Return the position of a particle [m], interpolated by `alpha` from the previous step (0) to the last
    step (1).

    Args: is_relative: 1 for a position relative to `view_origin`, 0 for a position in the world.
    """
    before, after = state.prev_position[p], state.particle_position[p]
    if is_relative == 1:
        body = state.particle_body[p]
        origin = state.body_origin[body]
        earlier = before - origin
        if (state.prev_local[p] + origin == before).all():
            earlier = state.prev_local[p]
        before, after = earlier, local_position(state, body, p)
    x = before + alpha * (after - before)
    if alpha == 1.0:
        x = after
    if is_relative == 1:
        view = state.view_origin[None]
        x += state.body_origin[state.particle_body[p]] - ti.Vector([view[0], view[1], view[2]])
        x -= ti.Vector([view[3], view[4], view[5]])
    return x


@ti.kernel
def write_view_origin(state: ti.template(), view: ti.types.ndarray(dtype=ti.f32, ndim=1)):
    """Write the point to which drawn positions are relative [m], and its rounding errors, (6,)."""
    for i in ti.static(range(6)):
        state.view_origin[None][i] = view[i]


@ti.func
def exact_position(state: ti.template(), body, p):
    """Return the position of a particle in the world in float64 [m]."""
    x = ti.cast(state.particle_position[p], ti.f64)
    if (state.body_origin[body] != 0.0).any():
        x = ti.cast(state.body_origin[body], ti.f64) + ti.cast(local_position(state, body, p), ti.f64)
    return x


@ti.func
def local_floor(state: ti.template(), body):
    """Return the floor with its height relative to the origin of a body."""
    floor = state.floor[None]
    floor.x -= state.body_origin[body].z
    return floor


@ti.func
def choose_origin(state: ti.template(), body, x):
    """Choose the origin of a body that is about to be placed at `x` [m]."""
    state.body_origin[body] = origin_near(x, ti.Vector.zero(state.real, 3))


@ti.func
def place_local(state: ti.template(), p, local, origin):
    """Place a particle at the position `local` relative to the `origin` of its body [m]."""
    state.particle_local[p] = local
    state.particle_position[p] = local + origin


@ti.func
def place_particle(state: ti.template(), body, p, x, residue):
    """Place a particle of a body that has its origin already.

    Args: x, residue: position in the world [m], and the rounding error of `x`.
    """
    state.particle_position[p] = x
    if (state.body_origin[body] != 0.0).any():
        place_local(state, p, x - state.body_origin[body] + residue, state.body_origin[body])


@ti.func
def place_exactly(state: ti.template(), p, x, origin):
    """Place a particle at a position `x` in float64 [m]. The caller then gives its body the `origin`."""
    state.particle_position[p] = ti.cast(x, state.real)
    if (origin != 0.0).any():
        place_local(state, p, ti.cast(x - ti.cast(origin, ti.f64), state.real), origin)


@ti.func
def _enter(state: ti.template(), body, origin):
    """Do the same as `enter_local` if the old or the new origin is not zero."""
    before = state.body_origin[body]
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        x, earlier = state.particle_position[p], state.prev_position[p]
        local = local_position(state, body, p)
        state.particle_position[p] = local
        state.prev_position[p] = ti.select((earlier == x).all(), local, earlier - before)
    if ti.static(state.capacity.has_hulls):
        for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            state.particle_position[p] = state.particle_position[p] - origin
    move = before - origin
    if (move != 0.0).any():
        has_pose = 0
        if ti.static(state.capacity.has_rigid):
            if is_rigid(state, body):
                has_pose = has_own_pose(state, body)
                shift_pose(state, body, move, has_pose)
        for p in range(particles[0], particles[1]):
            if has_pose == 0:
                state.particle_position[p] = state.particle_position[p] + move
            state.prev_position[p] = state.prev_position[p] + move
            if state.particle_aim[p] == TO_TARGET:
                state.particle_target[p] = state.particle_target[p] + move
        state.body_origin[body] = origin


@ti.func
def enter_local(state: ti.template(), body, origin):
    """Transform the positions of a body from the world to `origin` [m], which becomes its origin."""
    if (state.body_origin[body] != 0.0).any() or (origin != 0.0).any():
        _enter(state, body, origin)


@ti.func
def _leave(state: ti.template(), body):
    """Do the same as `leave_local` if the origin is not zero."""
    origin, particles = state.body_origin[body], state.body_particles[body]
    for p in range(particles[0], particles[1]):
        state.particle_local[p], state.prev_local[p] = state.particle_position[p], state.prev_position[p]
        state.particle_position[p] = state.particle_position[p] + origin
        state.prev_position[p] = state.prev_position[p] + origin
    if ti.static(state.capacity.has_hulls):
        for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
            state.particle_position[p] = state.particle_position[p] + origin


@ti.func
def leave_local(state: ti.template(), body):
    """Transform the positions of a body from its origin to the world, after `enter_local`."""
    if (state.body_origin[body] != 0.0).any():
        _leave(state, body)


@ti.kernel
def enter_all(state: ti.template(), body_count: ti.i32, moves: ti.i32) -> ti.i32:
    """Transform the positions of all bodies from the world to their origins.

    Args: moves: 1 if a body that is too far from its origin gets another one.
    Returns: number of bodies whose origin is not zero. If it is not 0, call `leave_all` later.
    """
    count = 0
    for body in range(body_count):
        origin = state.body_origin[body]
        if moves == 1:
            origin = origin_near(state.particle_position[state.body_particles[body][0]], origin)
        enter_local(state, body, origin)
        count += int((origin != 0.0).any())
    return count


@ti.kernel
def leave_all(state: ti.template(), body_count: ti.i32):
    """Transform the positions of all bodies from their origins to the world, after `enter_all`."""
    for body in range(body_count):
        leave_local(state, body)
