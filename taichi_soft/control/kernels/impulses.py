"""Impulses on particles between two steps, as immediate changes of velocity.

Leapfrog stores velocities half a substep earlier than positions. The change is added to these stored
velocities.
"""

from taichi_soft.bodies.status import ABSENT
from taichi_soft.core.constants import VELOCITY_LIMIT
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti


@ti.func
def falloff(distance2, radius2):
    """Return a smooth falloff from 1 at the centre to 0 at the radius and beyond.

    The slope is zero at the centre and at the radius.
    Args: distance2, radius2: squared distance and squared radius [m^2].
    """
    rest = ti.max(1.0 - distance2 / radius2, 0.0)
    return rest * rest


@ti.func
def _change_velocity(state: ti.template(), p, change):
    if state.particle_inv_mass[p] > 0.0:
        state.particle_velocity[p] = state.particle_velocity[p] + change


@ti.kernel
def add_velocity(
    state: ti.template(),
    particles: ti.types.ndarray(dtype=ti.i32, ndim=1),
    change: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Add `change`, (3,) [m/s], to the velocities of `particles`, except pinned ones."""
    ti.loop_config(serialize=True)
    for i in range(particles.shape[0]):
        _change_velocity(state, particles[i], ti.Vector([change[0], change[1], change[2]]))


@ti.kernel
def add_impulse_near(
    state: ti.template(),
    body: ti.i32,
    place: ti.types.ndarray(dtype=ti.f32, ndim=1),
    found: ti.types.ndarray(dtype=ti.f64, ndim=1),
):
    """Distribute an impulse over the particles around a point, in proportion to mass and `falloff`.

    Args:
        place: point [m], radius [m], impulse [N s]: (7,).
        found: receives the distance to the nearest particle [m] and the largest change of speed [m/s], (2,).
            If no particle is in range or the change is too large, the kernel changes nothing.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        point, radius = ti.Vector([place[0], place[1], place[2]]), place[3]
        impulse = ti.Vector([place[4], place[5], place[6]])
        particles = state.body_particles[body]
        nearest2 = ti.cast(ti.math.inf, ti.f32)
        weight, highest = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64)
        p = particles[0]
        while p < particles[1]:
            distance2 = (state.particle_position[p] - point).norm_sqr()
            share = ti.cast(falloff(distance2, radius * radius), ti.f64)
            nearest2 = ti.min(nearest2, distance2)
            highest = ti.max(highest, share)
            weight += share * state.particle_mass[p]
            p = row_behind(p)
        found[0] = ti.sqrt(nearest2)
        found[1] = 0.0
        if weight > 0.0:
            found[1] = highest / weight * impulse.norm()
            if found[1] < VELOCITY_LIMIT:
                p = particles[0]
                while p < particles[1]:
                    distance2 = (state.particle_position[p] - point).norm_sqr()
                    share = falloff(distance2, radius * radius) / weight
                    _change_velocity(state, p, ti.cast(share, ti.f32) * impulse)
                    p = row_behind(p)


@ti.kernel
def add_radial_impulse(
    state: ti.template(),
    body_count: ti.i32,
    place: ti.types.ndarray(dtype=ti.f32, ndim=1),
    found: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Apply a radial impulse to all bodies, away from a point.

    The change of a particle's velocity is proportional to `falloff` and to the inverse mass of its body.

    Args:
        place: centre [m], radius [m], impulse on a body at the centre [N s]: (5,).
        found: receives the largest possible change of speed [m/s], (1,). If this change is too large, the
            kernel changes nothing.
    """
    highest = ti.cast(0.0, ti.f32)
    ti.loop_config(serialize=True)
    for body in range(body_count):
        if state.body_status[body] < ABSENT:
            highest = ti.max(highest, ti.abs(place[4]) / _mass(state, body))
    ti.loop_config(serialize=True)
    for body in range(body_count):
        if highest < VELOCITY_LIMIT and state.body_status[body] < ABSENT:
            centre, radius2 = ti.Vector([place[0], place[1], place[2]]), place[3] * place[3]
            speed = place[4] / _mass(state, body)
            particles = state.body_particles[body]
            p = particles[0]
            while p < particles[1]:
                away = state.particle_position[p] - centre
                distance2 = away.norm_sqr()
                if 0.0 < distance2 < radius2:
                    change = speed * falloff(distance2, radius2) / ti.sqrt(distance2) * away
                    _change_velocity(state, p, change)
                p = row_behind(p)
    found[0] = highest


@ti.func
def _mass(state: ti.template(), body):
    particles = state.body_particles[body]
    mass = ti.cast(0.0, ti.f64)
    p = particles[0]
    while p < particles[1]:
        mass += state.particle_mass[p]
        p = row_behind(p)
    return ti.cast(mass, ti.f32)
