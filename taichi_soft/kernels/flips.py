"""A brake for flipped tetrahedra that are to recover.

The force that turns them back has no energy: a knot of them, each in the others' way, can drive itself and
would tremble for ever. So a flipped tetrahedron loses a share of the speed at which it flips further; what
turns it back stays free. The impulses, one tetrahedron after the other, add no energy, however short or long
the substep is, and keep momentum and angular momentum. Only the schedule `per_body` has them.
"""

from taichi_soft.constants import LANES
from taichi_soft.runtime import ti

FLIP_BRAKE = 0.1
"""Share of the rate of its volume that a tetrahedron loses in a substep while it flips further."""


@ti.func
def brake_flipped(state: ti.template(), block, lane):
    """Brake one flipped tetrahedron, in one thread, along the gradient of its volume.

    One with a pinned vertex is let be: its pin would have to take up an impulse that nobody counts.
    """
    p0 = state.tet_vertices[block * 4 * LANES + lane]
    p1 = state.tet_vertices[(block * 4 + 1) * LANES + lane]
    p2 = state.tet_vertices[(block * 4 + 2) * LANES + lane]
    p3 = state.tet_vertices[(block * 4 + 3) * LANES + lane]
    w0, w1 = state.particle_inv_mass[p0], state.particle_inv_mass[p1]
    w2, w3 = state.particle_inv_mass[p2], state.particle_inv_mass[p3]
    if w0 > 0.0 and w1 > 0.0 and w2 > 0.0 and w3 > 0.0:
        x0 = state.particle_position[p0]
        a = state.particle_position[p1] - x0
        b = state.particle_position[p2] - x0
        c = state.particle_position[p3] - x0
        v0 = state.particle_velocity[p0]
        g1, g2, g3 = b.cross(c), c.cross(a), a.cross(b)
        g0 = -(g1 + g2 + g3)
        rate = (
            g1.dot(state.particle_velocity[p1] - v0)
            + g2.dot(state.particle_velocity[p2] - v0)
            + g3.dot(state.particle_velocity[p3] - v0)
        )
        if rate < 0.0:
            ease = w0 * g0.dot(g0) + w1 * g1.dot(g1) + w2 * g2.dot(g2) + w3 * g3.dot(g3)
            push = -FLIP_BRAKE * rate / (ease + 1e-30)
            state.particle_velocity[p0] = v0 + push * w0 * g0
            state.particle_velocity[p1] = state.particle_velocity[p1] + push * w1 * g1
            state.particle_velocity[p2] = state.particle_velocity[p2] + push * w2 * g2
            state.particle_velocity[p3] = state.particle_velocity[p3] + push * w3 * g3
