"""Restore bodies with inverted tetrahedra.

Forces alone restore nearly all inverted tetrahedra. Every `PATIENCE` steps a body is checked for flat or
inverted tetrahedra. If a check finds any, the vibrations of the body are damped until a check finds none. A
body that is folded by its own weight can keep a few inverted tetrahedra for ever, because their forces
balance. Such a body is reported after `REPORTED_AFTER` steps and left as it is. A body with too many inverted
tetrahedra has lost its shape. Within a third of a second, its particles are moved to the best fit of the rest
shape.

The same checks find bodies that are stiffer than at rest, because tetrahedra are stretched. The usual substep
can be too long for these bodies. Parts of them would then vibrate for ever, so these bodies get more
substeps.
"""

from taichi_soft.bodies.kernels.origins import local_floor
from taichi_soft.bodies.status import PLACED
from taichi_soft.core.constants import LANES
from taichi_soft.core.math.elementary import exp
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.math.svd import nearest_rotation
from taichi_soft.core.math.tensors import determinant
from taichi_soft.core.math.tetrahedron import area_vectors, shape
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Flips
from taichi_soft.elements.kernels.elastic import particles_of, rest_inverse_of

PATIENCE = 15
"""Number of fixed steps between two checks of a body. At 60 steps/s, this is a quarter of a second."""

REPORTED_AFTER = 8 * PATIENCE
"""Number of fixed steps after which a body that still has inverted tetrahedra is reported. At 60 steps/s,
this is two seconds."""

FAILED_FRACTION = 0.1
"""Smallest fraction of inverted tetrahedra with which a body counts as failed. The fraction is compared only
after a retried step, or after the caller set the shape."""

RESTORING_STEPS, CALMING = 20, 0.8
"""RESTORING_STEPS is the number of steps in which a failed body moves to its rest shape. CALMING is the
fraction of the body's vibration that remains after each of these steps. The damping also restores bodies
that are twisted by two turns without an inverted tetrahedron."""

FADING = 20.0
"""Rate at which the vibration of a body with inverted tetrahedra is damped [1/s]. Without damping, inverted
slivers would excite each other. Light slivers would do so for seconds."""

STEP_MARGIN = 0.9
"""Square of the safety factor on the substep of a deformed body. The substep is sqrt(STEP_MARGIN) times the
estimated largest stable substep."""

MAX_REFINEMENT = 4.0
"""Largest factor by which a deformed body can raise the number of substeps, relative to its number at
rest. If the body needs more substeps, the step fails and is retried."""

RELAXING = 0.8
"""Fraction of the additional substeps that a body keeps at each check after its shape needs fewer. Their
number therefore falls gradually."""

FLAT = 1e-5
"""Volume below which a tetrahedron counts as inverted, as a fraction of its volume at rest."""


@ti.func
def _is_inverted(state: ti.template(), positions: ti.template(), block, lane):
    """Return 1 if a tetrahedron is flat or inverted."""
    p0, p1, p2, p3 = particles_of(state, block, lane)
    B = shape(positions[p0], positions[p1], positions[p2], positions[p3])
    inverse = determinant(rest_inverse_of(state, block, lane))  # 0 in the padding of the last block
    return int(inverse != 0.0) & int(determinant(B) * inverse < FLAT)


@ti.func
def _count_inverted(state: ti.template(), positions: ti.template(), body):
    caught, blocks = 0, state.body_blocks[body]
    row = blocks[0] * LANES
    while row < blocks[1] * LANES:
        caught += _is_inverted(state, positions, row // LANES, row % LANES)
        row = row_behind(row)
    return caught


@ti.func
def _stiffness_of(state: ti.template(), block, lane):
    """Return the square of a tetrahedron's highest frequency due to its resistance to a change of volume
    [1/s^2].

    In stable neo-Hookean material, the force that resists a change of volume is (lambda + 5/6 mu) (J - a)
    dV/dx, where dV/dx is a third of an area vector. The stiffness of this force grows with the square of
    dV/dx, so a stretched face makes the tetrahedron stiffer at any volume.
    Returns: the current value, and the value at rest.
    """
    ps = particles_of(state, block, lane)
    inverse = rest_inverse_of(state, block, lane)
    n = area_vectors(
        shape(
            state.particle_position[ps[0]],
            state.particle_position[ps[1]],
            state.particle_position[ps[2]],
            state.particle_position[ps[3]],
        )
    )
    a, b, c = inverse
    r1, r2, r3 = ti.Vector([a.x, b.x, c.x]), ti.Vector([a.y, b.y, c.y]), ti.Vector([a.z, b.z, c.z])
    r = (-(r1 + r2 + r3), r1, r2, r3)
    determinant6 = ti.abs(determinant(inverse))  # 1 / (6 V0)
    row = block * 2 * LANES + lane
    modulus = state.tet_lame[row] + state.tet_lame[row + LANES] * 5.0 / 6.0
    now, rest = a.x * 0.0, a.x * 0.0
    for corner in ti.static(range(4)):
        inv_mass = state.particle_inv_mass[ps[corner]]
        now += inv_mass * n[corner].dot(n[corner])
        rest += inv_mass * r[corner].dot(r[corner])
    return modulus * now * determinant6, modulus * rest / ti.max(determinant6, 1e-30)


@ti.func
def _refinement_of(state: ti.template(), body):
    """Return the factor, 1 or more, by which a body's current shape raises its number of substeps at rest."""
    now, rest = ti.cast(0.0, state.real), ti.cast(1e-30, state.real)
    row, blocks = state.body_blocks[body][0] * LANES, state.body_blocks[body]
    while row < blocks[1] * LANES:
        stiffness, stiffness_at_rest = _stiffness_of(state, row // LANES, row % LANES)
        now, rest = ti.max(now, stiffness), ti.max(rest, stiffness_at_rest)
        row = row_behind(row)
    return ti.max(1.0, ti.min(ti.sqrt(STEP_MARGIN * now / rest), MAX_REFINEMENT))


@ti.func
def _needs_rest_shape(state: ti.template(), body):
    """True if many tetrahedra were inverted before a retried step, or in the shape that the caller set."""
    is_wrecked = False
    if state.body_jolted[body] == 1 or state.body_patience[body] == PLACED:
        blocks = state.body_blocks[body]
        caught = _count_inverted(state, state.prev_position, body)
        is_wrecked = caught >= FAILED_FRACTION * LANES * (blocks[1] - blocks[0])
    return is_wrecked


@ti.func
def _best_fit(state: ti.template(), body):
    """Fit the rest shape to the current positions of a body.

    Returns: centre at rest, current centre [m], and rotation as three rows.
    """
    particles = state.body_particles[body]
    x0, r0 = state.particle_position[particles[0]], state.rest_position[particles[0]]
    total, now, rest = x0.x * 0.0, x0 * 0.0, x0 * 0.0
    p = particles[0]
    while p < particles[1]:
        mass = state.particle_mass[p]
        total += mass
        now += mass * (state.particle_position[p] - x0)
        rest += mass * (state.rest_position[p] - r0)
        p = row_behind(p)
    now, rest = x0 + now / total, r0 + rest / total
    a, b, c, size = x0 * 0.0, x0 * 0.0, x0 * 0.0, 1e-30
    p = particles[0]
    while p < particles[1]:
        share = state.particle_mass[p] / total
        x, r = state.particle_position[p] - now, state.rest_position[p] - rest
        a, b, c = a + share * r.x * x, b + share * r.y * x, c + share * r.z * x
        size += share * r.dot(r)
        p = row_behind(p)
    return rest, now, nearest_rotation((a / size, b / size, c / size))


@ti.func
def _move_to_rest_shape(state: ti.template(), program: ti.template(), body, steps_left, seconds):
    """Move the particles of a failed body by 1 / `steps_left` of the path to the best fit of the rest shape.

    Pinned particles do not move, and the floor stops other particles. If colliders can block the path,
    particles instead get the velocity with which they arrive in the next step of `seconds`. This velocity
    accounts for the damping at the beginning of that step.
    """
    rest, now, rows = _best_fit(state, body)
    particles = state.body_particles[body]
    p = particles[0]
    while p < particles[1]:
        if state.particle_inv_mass[p] > 0.0:
            r = state.rest_position[p] - rest
            goal = now + ti.Vector([rows[0].dot(r), rows[1].dot(r), rows[2].dot(r)])
            displacement = (goal - state.particle_position[p]) / steps_left
            if ti.static(program.has_contact):
                state.particle_velocity[p] = state.particle_velocity[p] + displacement / (CALMING * seconds)
            else:
                x = state.particle_position[p] + displacement
                if ti.static(program.has_floor):
                    x.z = ti.max(x.z, ti.min(local_floor(state, body).x, state.particle_position[p].z))
                state.particle_position[p] = x
        p = row_behind(p)


@ti.func
def _recovers(state: ti.template(), program: ti.template(), body):
    """Return 1 if the law of a body restores inverted tetrahedra."""
    recovers = 0
    for m, model in ti.static(enumerate(program.models)):
        if ti.static(model.flips == Flips.RECOVER):
            recovers = recovers | int(state.body_model[body] == m)
    return recovers


@ti.func
def _stiffens(state: ti.template(), program: ti.template(), body):
    """Return 1 if the law of a body can require more substeps, see `_refinement_of`."""
    stiffens = 0
    for m, model in ti.static(enumerate(program.models)):
        if ti.static(model.has_energy and model.flips == Flips.RECOVER):
            stiffens = stiffens | int(state.body_model[body] == m)
    return stiffens


@ti.func
def kept_while_inverted(state: ti.template(), body, h, is_first):
    """Return the fraction of a body's vibration that remains after a substep of `h` [s]; 1 without damping.

    A body with inverted tetrahedra is damped in every substep. If it were damped only at the beginning of
    steps, vibrations with twice the step's period would always be damped at their turning points. A failed
    body is damped only in the first substep of each step.
    """
    age, keep = state.body_patience[body], 1.0
    if age >= PATIENCE:
        keep = exp(-FADING * h)
    elif is_first and age >= -RESTORING_STEPS and age < 0:
        keep = CALMING
    return keep


@ti.real_func
def untangle_body(state: ti.template(), program: ti.template(), body: ti.i32, seconds: ti.f32) -> ti.i32:
    """Check a body at the end of a step of `seconds`, and restore it if necessary.

    Bodies whose law does not restore inverted tetrahedra are not checked.

    Returns: 1 if the body must be reported, because it has had inverted tetrahedra for too long.
    """
    is_reported = 0
    if _recovers(state, program, body) == 1:
        before = state.body_patience[body]
        age = ti.max(before, -RESTORING_STEPS - 1) + 1
        if before >= 0 or before == PLACED:  # otherwise, the body is already being restored
            if _needs_rest_shape(state, body):
                age = -RESTORING_STEPS
            elif before == PLACED:
                age = 0
        is_look = age >= 0 and age % PATIENCE == 0
        if (is_look or state.body_jolted[body] == 1) and _stiffens(state, program, body) == 1:
            kept = 1.0 + RELAXING * (state.body_refinement[body] - 1.0)
            state.body_refinement[body] = ti.max(_refinement_of(state, body), kept)
        if is_look:
            if _count_inverted(state, state.particle_position, body) == 0:
                age = 0
            is_reported = int(age == REPORTED_AFTER)
        if age < 0:
            _move_to_rest_shape(state, program, body, -age, seconds)
        state.body_patience[body] = age
        state.body_jolted[body] = 0
    return is_reported
