"""Kernels that move a whole body, or set its velocities, like a rigid body between two steps."""

from taichi_soft.bodies.kernels.origins import exact_position, origin_near, place_exactly
from taichi_soft.bodies.kernels.rods import set_rigid_spins, turn_frames
from taichi_soft.bodies.status import JUST_PLACED, TO_TARGET
from taichi_soft.core.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti


@ti.func
def _center_of_mass(state: ti.template(), body):
    """Return the centre of mass of a body [m], in float64."""
    particles = state.body_particles[body]
    moment, mass = ti.Vector.zero(ti.f64, 3), ti.cast(0.0, ti.f64)
    p = particles[0]
    while p < particles[1]:
        mass += state.particle_mass[p]
        moment += exact_position(state, body, p) * state.particle_mass[p]
        p = row_behind(p)
    return moment / mass


@ti.func
def _relative(state: ti.template(), body, p, center):
    return ti.cast(exact_position(state, body, p) - center, ti.f32)


@ti.kernel
def write_rigid_velocity(
    state: ti.template(),
    body: ti.i32,
    motion: ti.types.ndarray(dtype=ti.f32, ndim=1),
    found: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Set the velocities of one body to a rigid motion. Pinned particles keep their velocities.

    Args:
        motion: velocity of the centre of mass [m/s], angular velocity [rad/s]: (6,).
        found: receives the highest speed [m/s], (1,). If it is too high, nothing is changed.
    """
    fastest = ti.cast(0.0, ti.f32)
    ti.loop_config(serialize=True)
    for _ in range(1):
        linear = ti.Vector([motion[0], motion[1], motion[2]])
        angular = ti.Vector([motion[3], motion[4], motion[5]])
        center = _center_of_mass(state, body)
        particles = state.body_particles[body]
        p = particles[0]
        while p < particles[1]:
            fastest = ti.max(fastest, (linear + angular.cross(_relative(state, body, p, center))).norm())
            p = row_behind(p)
        if fastest < VELOCITY_LIMIT:
            p = particles[0]
            while p < particles[1]:
                if state.particle_inv_mass[p] > 0.0:
                    velocity = linear + angular.cross(_relative(state, body, p, center))
                    state.particle_velocity[p] = velocity
                p = row_behind(p)
            if ti.static(state.capacity.rods):
                set_rigid_spins(state, body, angular)
            state.body_velocity_lag[body] = 0.0
    found[0] = fastest


@ti.func
def _turned(turn: ti.template(), v):
    return ti.Vector([turn[i, 0] * v.x + turn[i, 1] * v.y + turn[i, 2] * v.z for i in ti.static(range(3))])


@ti.kernel
def jump(
    state: ti.template(),
    body: ti.i32,
    place: ti.types.ndarray(dtype=ti.f64, ndim=1),
    turn: ti.types.ndarray(dtype=ti.f64, ndim=2),
    found: ti.types.ndarray(dtype=ti.f64, ndim=1),
):
    """Rotate one body about its centre of mass and move it.

    The body's previous positions and the targets of its pins move too.
    Args:
        place: new centre of mass [m], smallest allowed height [m], factor of the velocities: (5,).
        turn: rotation matrix (3, 3).
        found: receives the lowest height, the highest height and the largest coordinate of the moved body
            [m], (3,). If the body would be too low or out of range, nothing is changed.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        target = ti.Vector([place[0], place[1], place[2]])
        center = _center_of_mass(state, body)
        particles = state.body_particles[body]
        lowest, highest = ti.cast(ti.math.inf, ti.f64), ti.cast(-ti.math.inf, ti.f64)
        farthest = ti.cast(0.0, ti.f64)
        p = particles[0]
        while p < particles[1]:
            x = _turned(turn, exact_position(state, body, p) - center) + target
            lowest, highest = ti.min(lowest, x.z), ti.max(highest, x.z)
            farthest = ti.max(farthest, ti.abs(x.x), ti.abs(x.y), ti.abs(x.z))
            p = row_behind(p)
        found[0], found[1], found[2] = lowest, highest, farthest
        if farthest < POSITION_LIMIT and lowest >= place[3] - 1e-3 * (highest - lowest):
            origin = origin_near(ti.cast(target, ti.f32), ti.Vector.zero(ti.f32, 3))
            p = particles[0]
            while p < particles[1]:
                earlier = ti.cast(state.prev_position[p], ti.f64) - center
                state.prev_position[p] = ti.cast(_turned(turn, earlier) + target, ti.f32)
                x = _turned(turn, exact_position(state, body, p) - center) + target
                place_exactly(state, p, x, origin)
                for old in ti.static((state.particle_velocity, state.prev_velocity)):
                    old[p] = ti.cast(_turned(turn, ti.cast(old[p], ti.f64)) * place[4], ti.f32)
                if state.particle_aim[p] == TO_TARGET:
                    before = ti.cast(state.body_origin[body], ti.f64)
                    after = (
                        _turned(turn, before + ti.cast(state.particle_target[p], ti.f64) - center) + target
                    )
                    state.particle_target[p] = ti.cast(after - ti.cast(origin, ti.f64), ti.f32)
                if ti.static(state.capacity.implicit):
                    state.particle_contact[p] = 0
                p = row_behind(p)
            state.body_origin[body] = origin
            if ti.static(state.capacity.rods):
                axes = ti.Matrix([[ti.cast(turn[i, k], ti.f32) for k in range(3)] for i in range(3)])
                turn_frames(state, body, axes, ti.cast(place[4], ti.f32))
            state.body_overlap[body] = JUST_PLACED
