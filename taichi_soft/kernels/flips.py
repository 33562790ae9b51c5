"""A brake for flipped tetrahedra that are to recover.

The force that turns them back has no energy: a knot of them, each in the others' way, can drive itself and
would tremble for ever. So in every substep a flipped tetrahedron loses a share of the speed at which it goes
further astray: at which its volume falls, and at which its edges leave their rest lengths. (In a body crushed
to a line no volume changes, but edges do.) The impulses, one after the other, add no energy, however short or
long the substep is, and keep momentum and angular momentum. Only the schedule `per_body` has them.
"""

from taichi_soft.constants import LANES
from taichi_soft.runtime import ti

FLIP_BRAKE = 0.1
"""Share of each of these speeds. Braking the way back as much would leave bodies half turned."""


@ti.func
def _rest_corners(state: ti.template(), block, lane):
    """Corners of one tetrahedron at rest, the first at the origin, as columns (3, 4) [m]."""
    base = block * 9 * LANES + lane
    a = [state.tet_rest_inverse[base + k * LANES] for k in ti.static(range(9))]
    edges = ti.Matrix([[a[0], a[3], a[6]], [a[1], a[4], a[7]], [a[2], a[5], a[8]]]).inverse()
    return ti.Matrix([[a[0] * 0.0, edges[i, 0], edges[i, 1], edges[i, 2]] for i in range(3)])


@ti.func
def _push(state: ti.template(), p, impulse):
    state.particle_velocity[p] = state.particle_velocity[p] + state.particle_inv_mass[p] * impulse


@ti.func
def _brake_volume(state: ti.template(), p0, p1, p2, p3):
    """Along the gradient of the volume, if it falls."""
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
def _brake_edge(state: ti.template(), p, q, rest):
    """Along an edge that leaves its rest length; `rest` is its vector at rest [m]."""
    r = state.particle_position[q] - state.particle_position[p]
    rate = r.dot(state.particle_velocity[q] - state.particle_velocity[p])
    if rate * (r.dot(r) - rest.dot(rest)) > 0.0:
        ease = r.dot(r) * (state.particle_inv_mass[p] + state.particle_inv_mass[q])
        impulse = r * (FLIP_BRAKE * rate / (ease + 1e-30))
        _push(state, p, impulse)
        _push(state, q, -impulse)


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
        rest = _rest_corners(state, block, lane)
        for a in range(3):
            for b in range(a + 1, 4):
                _brake_edge(state, p[a], p[b], rest[:, b] - rest[:, a])
