"""Write colliders to their fields, and read the impulses on them.

Groups of fields: writes colliders.
"""

from taichi_soft.bodies.kernels.origins import residue_of
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti

MOTION_WIDTH = 23
"""Number of columns of `write_collider_motion`: position, quaternion, velocity, angular velocity, lower and
upper corner of the swept box, highest speed, rounding error of the position."""

SPEED = 19
"""Column of the highest speed."""


@ti.func
def _vector(rows: ti.template(), c, at):
    return ti.Vector([rows[c, at], rows[c, at + 1], rows[c, at + 2]])


@ti.kernel
def write_collider_motion(colliders: ti.template(), rows: ti.types.ndarray(dtype=ti.f32, ndim=2)):
    """Write poses and motion of all colliders from rows (n, `MOTION_WIDTH`)."""
    c = 0
    while c < rows.shape[0]:
        colliders.position[c] = _vector(rows, c, 0)
        colliders.rotation[c] = ti.Vector([rows[c, 3], rows[c, 4], rows[c, 5], rows[c, 6]])
        colliders.velocity[c] = _vector(rows, c, 7)
        colliders.spin[c] = _vector(rows, c, 10)
        colliders.lower[c] = _vector(rows, c, 13)
        colliders.upper[c] = _vector(rows, c, 16)
        colliders.speed[c] = rows[c, 19]
        colliders.position_residue[c] = residue_of(colliders.position[c], _vector(rows, c, 20))
        c = row_behind(c)


@ti.kernel
def write_samples(colliders: ti.template(), begin: ti.i32, samples: ti.types.ndarray(dtype=ti.f32, ndim=1)):
    """Write the grid samples of one solid to the rows from `begin` on."""
    for i in range(samples.shape[0]):
        colliders.samples[begin + i] = samples[i]


@ti.kernel
def sum_collider_impulses(
    colliders: ti.template(), body_count: ti.i32, out: ti.types.ndarray(dtype=ti.f32, ndim=2)
):
    """Sum the impulses of all bodies on each collider in the last step.

    Args: out: receives impulse and angular impulse on each collider, (n, 6) [N s, N m s].
    """
    ti.loop_config(serialize=True)
    for c in range(out.shape[0]):
        linear, angular = ti.Vector.zero(ti.f32, 3), ti.Vector.zero(ti.f32, 3)
        body = 0
        while body < body_count:
            row = body * colliders.capacity.colliders + c
            linear += colliders.impulse[row]
            angular += colliders.angular_impulse[row]
            body = row_behind(body)
        for i in ti.static(range(3)):
            out[c, i] = linear[i]
            out[c, 3 + i] = angular[i]


@ti.kernel
def forget_collider(colliders: ti.template(), body_count: ti.i32, c: ti.i32):
    """Clear the impulses and rebound speeds of collider `c`, before another collider gets this index."""
    ti.loop_config(serialize=True)
    for body in range(body_count):
        row = body * colliders.capacity.colliders + c
        colliders.impulse[row] = ti.Vector.zero(ti.f32, 3)
        colliders.angular_impulse[row] = ti.Vector.zero(ti.f32, 3)
        colliders.rebound[row] = 0.0
