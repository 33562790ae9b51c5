"""External forces of a step (applied forces, linear damping and wind), and the load on pinned particles.

The forces act on the velocities for their exact duration, so that their impulse over a step is exact. With
leapfrog, velocities are at half substeps. Half of a substep's impulse is therefore applied before the first
kick, and the other half after the last kick.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.bodies.kernels.rods import damp_spins
from taichi_soft.bodies.status import ACTIVE, DAMPED, FEELS_REACTION, PUSHED, SHELTERED, SKIPPING
from taichi_soft.core.math.elementary import exp
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti


@ti.func
def apply_external_forces(state: ti.template(), body, seconds):
    """Change the velocities of one body by applied forces and linear damping during `seconds`."""
    drives = state.body_drives[body]
    if drives & (PUSHED | DAMPED) != 0:
        keep = exp(-seconds * state.body_damping[body])
        lasting = ti.select(drives & PUSHED != 0, seconds, 0.0)
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            impulse = lasting * state.particle_push[p]
            inv_mass = state.particle_inv_mass[p]
            if inv_mass > 0.0:
                state.particle_velocity[p] = keep * state.particle_velocity[p] + inv_mass * impulse
            elif drives & FEELS_REACTION != 0:
                state.particle_reaction[p] = state.particle_reaction[p] + impulse
        if ti.static(state.capacity.rods):
            damp_spins(state, body, keep)


@ti.real_func
def apply_wind(state: ti.template(), body: ti.i32, h: ti.f32):
    """Change the velocities of one body by wind during `h` [s], triangle by triangle.

    The force on a triangle is 1/4 rho c_d A |v_n| v_n. Each vertex gets a third of this force. The
    integration is implicit, so that a vertex never exceeds the wind's speed along the normal.
    """
    wind = state.wind[None]
    drives = state.body_drives[body]
    if wind.w > 0.0 and drives & SHELTERED == 0:
        triangles = state.body_triangles[body]
        t = triangles[0]
        while t < triangles[1]:
            corners = state.triangle_vertices[t]
            a, b, c = corners[0], corners[1], corners[2]
            x = state.particle_position[a]
            across = (state.particle_position[b] - x).cross(state.particle_position[c] - x)
            twice_area = across.norm() + 1e-30
            n = across / twice_area
            sum = state.particle_velocity[a] + state.particle_velocity[b] + state.particle_velocity[c]
            flow = ti.abs((wind.xyz - sum / 3.0).dot(n))
            drag = wind.w * twice_area * flow / 24.0  # force on a vertex / normal velocity [kg/s]
            for i in range(3):
                p = corners[i]
                inv_mass = state.particle_inv_mass[p]
                past = (wind.xyz - state.particle_velocity[p]).dot(n)
                impulse = h * drag * past / (1.0 + h * drag * inv_mass) * n
                state.particle_velocity[p] = state.particle_velocity[p] + inv_mass * impulse
                if inv_mass == 0.0 and drives & FEELS_REACTION != 0:
                    state.particle_reaction[p] = state.particle_reaction[p] + impulse
            t = row_behind(t)


@ti.real_func
def add_reactions(state: ti.template(), body: ti.i32, seconds: ti.f32):
    """Accumulate the impulse of internal forces and gravity on pinned particles [N s] during `seconds`."""
    if state.body_drives[body] & FEELS_REACTION != 0:
        gravity = gravity_on(state, body)
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            if state.particle_inv_mass[p] == 0.0:
                force = state.particle_force[p].xyz + state.particle_mass[p] * gravity
                state.particle_reaction[p] = state.particle_reaction[p] + seconds * force


@ti.func
def _open_pushes(state: ti.template(), body):
    """Clear the applied forces of an earlier step, before the first force for the next step is added."""
    if state.body_drives[body] & PUSHED == 0:
        state.body_drives[body] = state.body_drives[body] | PUSHED
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            state.particle_push[p] = ti.Vector.zero(state.real, 3)


@ti.kernel
def add_push(
    state: ti.template(),
    body: ti.i32,
    particles: ti.types.ndarray(dtype=ti.i32, ndim=1),
    acceleration: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Accelerate `particles` of one body during the next step by `acceleration`, (3,) [m/s^2]."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        if state.body_status[body] == SKIPPING:  # a body with an applied force must not skip the step
            state.body_status[body] = ACTIVE
        _open_pushes(state, body)
        a = ti.Vector([acceleration[0], acceleration[1], acceleration[2]])
        for i in range(particles.shape[0]):
            p = particles[i]
            state.particle_push[p] = state.particle_push[p] + state.particle_mass[p] * a


@ti.kernel
def add_pushes(state: ti.template(), body: ti.i32, accelerations: ti.types.ndarray(dtype=ti.f32, ndim=2)):
    """Accelerate the vertices of one body during the next step by `accelerations`, (n, 3) [m/s^2]."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        _open_pushes(state, body)
        for i in range(accelerations.shape[0]):
            p = state.particle_of_vertex[state.body_particles[body][0] + i]
            a = ti.Vector([accelerations[i, 0], accelerations[i, 1], accelerations[i, 2]])
            state.particle_push[p] = state.particle_push[p] + state.particle_mass[p] * a


@ti.kernel
def write_gravity_scale(state: ti.template(), body: ti.i32, scale: ti.f32):
    """Write the factor by which gravity is multiplied for one body."""
    state.body_gravity_scale[body] = scale


@ti.kernel
def write_linear_damping(state: ti.template(), body: ti.i32, rate: ti.f32):
    """Write the linear damping rate of one body [1/s]."""
    state.body_damping[body] = rate
    _set_bit(state, body, DAMPED, int(rate > 0.0))


@ti.kernel
def write_shelter(state: ti.template(), body: ti.i32, is_sheltered: ti.i32):
    """Shelter one body from the wind if `is_sheltered` is 1. Expose it if `is_sheltered` is 0."""
    _set_bit(state, body, SHELTERED, is_sheltered)


@ti.kernel
def write_wind(state: ti.template(), wind: ti.types.ndarray(dtype=ti.f32, ndim=1)) -> ti.i32:
    """Write the wind: velocity [m/s], and density times drag coefficient [kg/m^3].

    Returns: 1 if the wind changed, else 0.
    """
    given = ti.Vector([wind[0], wind[1], wind[2], wind[3]])
    differs = int((given != state.wind[None]).any())
    state.wind[None] = given
    return differs


@ti.func
def _set_bit(state: ti.template(), body, bit, is_set):
    state.body_drives[body] = (state.body_drives[body] & ~bit) | ti.select(is_set != 0, bit, 0)
