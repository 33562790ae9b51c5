"""Grabs: their fields, and springs that pull a patch of a body's surface to a target.

A grab is a soft constraint (Catto, Soft Constraints, GDC 2011): its spring and its damper use the velocity
after the pull, so that the grab does not overshoot for any stiffness. Each particle of the patch gets a
fraction of the force. The part of a force above the strength of the patch acts on the whole body in
proportion to mass, which causes no deformation.

Groups of fields: writes grabs.
"""

from taichi_soft.bodies.kernels.origins import residue_of
from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.bodies.kernels.rigid import is_rigid
from taichi_soft.bodies.status import GRABBED
from taichi_soft.core.field_table import BODY, FINITE, PARTICLE, REAL, Below, FieldGroup, declare
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.linear_system import add_inertia

MOST_GRABS, PATCH_ROWS = 16, 128
"""MOST_GRABS is the largest number of grabs of a world. PATCH_ROWS is the largest number of particles of a
grab's patch."""

CORNERS = 4
"""Number of corners of the element that contains a grabbed point. The element is a triangle whose first
corner is stored twice. After a change of level, it is a tetrahedron."""

PLACE, LIMITS, FORCE, RESIDUE = slice(0, 4), slice(10, 13), slice(13, 16), slice(16, 19)
"""Columns of `numbers` in `write_grab` and `read_grab`: the weights of the corners, the limits, the force,
the rounding error of the target."""


ALL_GRABS, USED_GRABS, PATCHES = "grabs", "used grabs", "patches of grabs"
"""Groups of rows in a snapshot: all grabs, the grabs up to the last one in use, and the patches of these
grabs."""


class GrabFields(FieldGroup):
    """All grabs of a world, each with the rows of its patch."""

    owner = "control"
    body = declare(  # index plus 1, 0 if unused
        MOST_GRABS, ti.i32, start=0, keep=ALL_GRABS, below=Below(BODY, 1), native=True
    )
    corners = declare(
        MOST_GRABS, ti.i32, CORNERS, start=0, keep=USED_GRABS, below=Below(PARTICLE), native=True
    )
    weights = declare(  # barycentric coordinates of the grabbed point
        MOST_GRABS, REAL, CORNERS, start=0, keep=USED_GRABS, most=FINITE, native=True
    )
    target = declare(MOST_GRABS, REAL, 3, unit="m", start=0, keep=USED_GRABS, most=FINITE, native=True)
    residue = declare(  # rounding error of the target
        MOST_GRABS, REAL, 3, unit="m", start=0, keep=USED_GRABS, most=FINITE, native=True
    )
    # Stiffness [N/m], damping [N s/m] and longest stretch [m].
    spring = declare(MOST_GRABS, REAL, 3, start=0, keep=USED_GRABS, most=FINITE, native=True)
    limits = declare(MOST_GRABS, REAL, 3, start=0, keep=USED_GRABS, most=FINITE, native=True)
    # Force on the body in the last substep.
    force = declare(MOST_GRABS, REAL, 3, unit="N", start=0, keep=USED_GRABS, native=True)
    count = declare(  # number of rows of the patch
        MOST_GRABS, ti.i32, start=0, keep=USED_GRABS, below=Below(beside=PATCH_ROWS + 1), native=True
    )
    particle = declare(
        MOST_GRABS * PATCH_ROWS, ti.i32, start=0, keep=PATCHES, below=Below(PARTICLE), native=True
    )
    share = declare(MOST_GRABS * PATCH_ROWS, REAL, start=0, keep=PATCHES, most=FINITE, native=True)


@ti.func
def _stretch(state: ti.template(), g):
    """Return the vector from a grab's target to the grabbed point [m], limited to the longest stretch."""
    corners, weights = state.grabs.corners[g], state.grabs.weights[g]
    point = ti.Vector.zero(state.real, 3)
    for i in ti.static(range(CORNERS)):
        point += weights[i] * state.particle_position[corners[i]]
    target = state.grabs.target[g] - state.body_origin[state.grabs.body[g] - 1] + state.grabs.residue[g]
    stretch = point - target
    return stretch * ti.min(1.0, state.grabs.spring[g].z / ti.max(stretch.norm(), 1e-12))


@ti.func
def _rest_of_pull(state: ti.template(), g, wanted, h, drag):
    """Return the change of a body's velocity [m/s] by the force of a grab above the strength of its patch.

    Args:
        wanted: force of spring and damper at the velocity after the pull [N].
        drag: decrease of this force if the velocity increases by 1 m/s [N s/m].
    """
    on_patch, on_all, inv_mass = state.grabs.limits[g].x, state.grabs.limits[g].y, state.grabs.limits[g].z
    force = wanted / (1.0 + h * drag * inv_mass)
    size = ti.max(force.norm(), 1e-30)
    return ti.max(ti.min(size, on_all) - on_patch, 0.0) / size * h * inv_mass * force


@ti.func
def _pull_rigid(state: ti.template(), g, pull, drag, gravity, h, kick):
    """Apply a grab to a rigid body. Its four vertices carry the force like one that acts at the point."""
    after, inv_mass = kick * gravity, ti.cast(0.0, state.real)
    for i in ti.static(range(CORNERS)):
        p, weight = state.grabs.corners[g][i], state.grabs.weights[g][i]
        force = state.particle_force[p].xyz * state.particle_inv_mass[p]
        after += weight * (state.particle_velocity[p] + kick * force)
        inv_mass += weight * weight * state.particle_inv_mass[p]
    impulse = -h * (pull + drag * after) / (1.0 + h * drag * inv_mass)
    impulse *= ti.min(1.0, h * state.grabs.limits[g].y / ti.max(impulse.norm(), 1e-30))
    for i in ti.static(range(CORNERS)):
        p, weight = state.grabs.corners[g][i], state.grabs.weights[g][i]
        change = weight * state.particle_inv_mass[p] * impulse
        state.particle_velocity[p] = state.particle_velocity[p] + change
    state.grabs.force[g] = impulse / h


@ti.func
def _pull_patch(state: ti.template(), g, pull, drag, gravity, h, kick):
    """Apply a grab to the patch of a body that can deform, and the rest of the force to the whole body."""
    body = state.grabs.body[g] - 1
    particles = state.body_particles[body]
    part = ti.cast(0.0, state.real)
    wanted, total = -pull, ti.Vector.zero(state.real, 3)
    for turn in range(2):  # first compute the total force, then apply the limited force
        total = ti.Vector.zero(state.real, 3)
        row = g * PATCH_ROWS
        while row < g * PATCH_ROWS + state.grabs.count[g]:
            p, share = state.grabs.particle[row], state.grabs.share[row]
            inv_mass = state.particle_inv_mass[p]
            if inv_mass > 0.0:
                v = state.particle_velocity[p]
                after = v + kick * (state.particle_force[p].xyz * inv_mass + gravity)
                impulse = -h * share * (pull + drag * after) / (1.0 + h * share * drag * inv_mass)
                state.particle_velocity[p] = v + part * inv_mass * impulse
                total += impulse
                wanted -= ti.select(turn == 0, share * drag, 0.0) * (v + kick * gravity)
            row = row_behind(row)
        if turn == 0:
            part = ti.min(1.0, h * state.grabs.limits[g].x / ti.max(total.norm(), 1e-30))
    change = _rest_of_pull(state, g, wanted, h, drag)
    if change.norm_sqr() > 0.0:
        p = particles[0]
        while p < particles[1]:
            if state.particle_inv_mass[p] > 0.0:
                state.particle_velocity[p] = state.particle_velocity[p] + change
            p = row_behind(p)
    state.grabs.force[g] = (part * total + change / state.grabs.limits[g].z) / h


@ti.real_func
def pull_grabs(state: ti.template(), body: ti.i32, h: ti.f32, kick: ti.f32):
    """Change the velocities of one body by its grabs during `h` [s].

    The springs use the velocities after a kick of `kick` [s] by the forces of this substep, so that the pull
    also balances these forces.
    """
    if state.body_drives[body] & GRABBED != 0:
        gravity = gravity_on(state, body)
        for g in range(MOST_GRABS):
            if state.grabs.body[g] == body + 1:
                spring = state.grabs.spring[g]
                pull = spring.x * _stretch(state, g)
                drag = spring.y + h * spring.x
                if is_rigid(state, body):
                    _pull_rigid(state, g, pull, drag, gravity, h, kick)
                else:
                    _pull_patch(state, g, pull, drag, gravity, h, kick)


@ti.func
def add_grabs(state: ti.template(), body, h):
    """Add the grabs of one body to the matrix and right-hand side of implicit Euler's system."""
    if state.body_drives[body] & GRABBED != 0:
        gravity = gravity_on(state, body)
        particles = state.body_particles[body]
        for g in range(MOST_GRABS):
            if state.grabs.body[g] == body + 1:
                spring = state.grabs.spring[g]
                pull = spring.x * _stretch(state, g)
                drag = spring.y + h * spring.x
                part = ti.cast(1.0, state.real)
                wanted = ti.Vector.zero(state.real, 3)
                for turn in range(2):
                    for row in range(g * PATCH_ROWS, g * PATCH_ROWS + state.grabs.count[g]):
                        p, share = state.grabs.particle[row], state.grabs.share[row]
                        if state.particle_inv_mass[p] > 0.0:
                            force = -share * (pull + drag * state.particle_velocity[p])
                            if turn == 0:
                                wanted += force
                            else:
                                _add_force(state, p, part * h * force)
                                add_inertia(state, p, part * share * h * drag)
                    if turn == 0:
                        part = ti.min(1.0, state.grabs.limits[g].x / ti.max(wanted.norm(), 1e-30))
                change = _rest_of_pull(state, g, wanted - h * drag * gravity, h, drag)
                if change.norm_sqr() > 0.0:
                    for p in range(particles[0], particles[1]):
                        if state.particle_inv_mass[p] > 0.0:
                            _add_force(state, p, state.particle_mass[p] * change)
                state.grabs.force[g] = part * wanted + change / (h * state.grabs.limits[g].z)


@ti.func
def _add_force(state: ti.template(), p, impulse):
    rhs = state.residual[p] + impulse
    state.residual[p] = rhs
    state.particle_force[p] = widened(rhs)


@ti.func
def _write_residue(state: ti.template(), g, residue):
    state.grabs.residue[g] = residue_of(state.grabs.target[g], residue)


@ti.kernel
def write_grab(
    state: ti.template(),
    g: ti.i32,
    body: ti.i32,
    corners: ti.types.ndarray(dtype=ti.i32, ndim=1),
    numbers: ti.types.ndarray(dtype=ti.f32, ndim=1),
    patch: ti.types.ndarray(dtype=ti.i32, ndim=1),
    shares: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Write a new grab, or new particles of an existing grab.

    Args:
        corners: particles of the grabbed point's element, (4,).
        numbers: (19,): weights of the corners; target [m]; stiffness [N/m], damping [N s/m] and longest
            stretch [m] of the spring; largest force on the patch and in total [N]; 1 / mass of the body
            [1/kg]; force in the last substep [N]; rounding error of the target [m].
        patch: particles of the patch, at most `PATCH_ROWS`.
        shares: fraction of the force on each of these particles.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        state.grabs.body[g] = body + 1
        for k in ti.static(range(CORNERS)):
            state.grabs.corners[g][k] = corners[k]
            state.grabs.weights[g][k] = numbers[k]
        for k in ti.static(range(3)):
            state.grabs.target[g][k] = numbers[4 + k]
            state.grabs.spring[g][k] = numbers[7 + k]
            state.grabs.limits[g][k] = numbers[10 + k]
            state.grabs.force[g][k] = numbers[13 + k]
        _write_residue(state, g, ti.Vector([numbers[16], numbers[17], numbers[18]]))
        state.grabs.count[g] = patch.shape[0]
        for i in range(patch.shape[0]):
            state.grabs.particle[g * PATCH_ROWS + i] = patch[i]
            state.grabs.share[g * PATCH_ROWS + i] = shares[i]
        state.body_drives[body] = state.body_drives[body] | GRABBED


@ti.kernel
def write_grab_target(state: ti.template(), g: ti.i32, target: ti.types.ndarray(dtype=ti.f32, ndim=1)):
    """Write the target of a grab [m] and its rounding error, (6,)."""
    state.grabs.target[g] = ti.Vector([target[0], target[1], target[2]])
    _write_residue(state, g, ti.Vector([target[3], target[4], target[5]]))


@ti.kernel
def end_grab(state: ti.template(), g: ti.i32, body: ti.i32):
    """Remove a grab of a body."""
    others = 0
    state.grabs.body[g] = 0
    ti.loop_config(serialize=True)
    for each in range(MOST_GRABS):
        others += int(state.grabs.body[each] == body + 1)
    if others == 0:
        state.body_drives[body] = state.body_drives[body] & ~GRABBED


@ti.kernel
def read_grab(
    state: ti.template(),
    g: ti.i32,
    corners: ti.types.ndarray(dtype=ti.i32, ndim=1),
    numbers: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Read the corners and numbers of a grab, (4,) and (19,), in the layout of `write_grab`."""
    for k in ti.static(range(CORNERS)):
        corners[k] = state.grabs.corners[g][k]
        numbers[k] = state.grabs.weights[g][k]
    for k in ti.static(range(3)):
        numbers[4 + k] = state.grabs.target[g][k]
        numbers[7 + k] = state.grabs.spring[g][k]
        numbers[10 + k] = state.grabs.limits[g][k]
        numbers[13 + k] = state.grabs.force[g][k]
        numbers[16 + k] = state.grabs.residue[g][k]
