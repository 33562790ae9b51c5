"""A brake for flipped tetrahedra that are to recover.

Where a tetrahedron turns over its force jumps (`laws.recovery`), and it turns over between two substeps: it goes
on for a moment under the force of the side that it has left. One that is held so that either side sends it to
the other gains by that, and would tremble for ever. So in every substep a flipped tetrahedron loses a share of
the speed at which its volume falls further, by an impulse along the gradient of the volume: it keeps momentum and
angular momentum and, one after the other, adds no energy, however short or long the substep is. Only the schedule
`per_body` has it.
"""

from taichi_soft.constants import LANES
from taichi_soft.runtime import ti

FLIP_BRAKE = 0.1
"""Share of that speed. (Of 0.3 some knots that tremble do not come to rest.)"""


@ti.func
def _push(state: ti.template(), p, impulse):
    state.particle_velocity[p] = state.particle_velocity[p] + state.particle_inv_mass[p] * impulse


@ti.func
def _brake_volume(state: ti.template(), p0, p1, p2, p3):
    x0, v0 = state.particle_position[p0], state.particle_velocity[p0]
    a = state.particle_position[p1] - x0
    b = state.particle_position[p2] - x0
    c = state.particle_position[p3] - x0
    g1, g2, g3 = b.cross(c), c.cross(a), a.cross(b)
    g0 = -(g1 + g2 + g3)
    rate = g1.dot(state.particle_velocity[p1] - v0)
    rate += g2.dot(state.particle_velocity[p2] - v0)
    rate += g3.dot(state.particle_velocity[p3] - v0)
    if rate < 0.0:
        ease = state.particle_inv_mass[p0] * g0.dot(g0) + state.particle_inv_mass[p1] * g1.dot(g1)
        ease += state.particle_inv_mass[p2] * g2.dot(g2) + state.particle_inv_mass[p3] * g3.dot(g3)
        share = -FLIP_BRAKE * rate / (ease + 1e-30)
        _push(state, p0, share * g0)
        _push(state, p1, share * g1)
        _push(state, p2, share * g2)
        _push(state, p3, share * g3)


@ti.func
def brake_flipped(state: ti.template(), block, lane):
    """Brake one flipped tetrahedron, in one thread.

    One with a pinned vertex is let be: its pin would have to take up an impulse that nobody counts.
    """
    p = ti.Vector([state.tet_vertices[(block * 4 + corner) * LANES + lane] for corner in range(4)])
    is_free = 1
    for corner in ti.static(range(4)):
        is_free = is_free & int(state.particle_inv_mass[p[corner]] > 0.0)
    if is_free == 1:
        _brake_volume(state, p[0], p[1], p[2], p[3])
