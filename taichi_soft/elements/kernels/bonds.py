"""Forces along and across edges: load values, call the law, store forces."""

from taichi_soft.core.constants import LANES
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.elastic import BLOCK_BITS, particles_of
from taichi_soft.elements.laws.best_fitting_plane import plane_normal
from taichi_soft.elements.laws.bonds import Ring
from taichi_soft.elements.laws.cmpm import bond_damping, bond_force, direction_of
from taichi_soft.elements.laws.cmpm2 import subface
from taichi_soft.elements.laws.tilted_plane import tilt, tilted_normal
from taichi_soft.elements.laws.volume_springs import expansion


@ti.func
def lane_pressure(state: ti.template(), block, lane):
    """Pressure of one tetrahedron on its edges [Pa]: dV / V0 times the expansion modulus E nu."""
    p0, p1, p2, p3 = particles_of(state, block, lane)
    growth = expansion(
        state.particle_position[p0],
        state.particle_position[p1],
        state.particle_position[p2],
        state.particle_position[p3],
        state.tet_inverse_volume6[block * LANES + lane],
    )
    return growth * state.tet_expansion_modulus[block * LANES + lane]


@ti.func
def store_block_pressures(state: ti.template(), number):
    """Store the pressures of a block's tetrahedra for `ring_tension`."""
    block = number & BLOCK_BITS
    pressure = ti.Vector.zero(state.real, LANES)
    for lane in range(LANES):
        pressure[lane] = lane_pressure(state, block, lane)
    for lane in range(LANES):
        state.tet_pressure[block * LANES + lane] = pressure[lane]


@ti.func
def accumulate_pressures(state: ti.template(), body):
    """Store the pressures of a body's tetrahedra, and their sum for each edge, in one thread."""
    edges, blocks = state.body_edges[body], state.body_blocks[body]
    for e in range(edges[0], edges[1]):
        state.edge_pressure[e] = 0.0
    for number in range(blocks[0], blocks[1]):
        store_block_pressures(state, number)
    for number in range(blocks[0], blocks[1]):
        block = number & BLOCK_BITS
        for lane in range(LANES):
            pressure = state.tet_pressure[block * LANES + lane]
            for k in ti.static(range(6)):
                e = state.tet_edges[(block * 6 + k) * LANES + lane]
                state.edge_pressure[e] = state.edge_pressure[e] + pressure


@ti.func
def _corner(state: ti.template(), k, origin):
    """Position of the corner of a Voronoi face in ring row `k`, relative to `origin` [m]."""
    members, weights = state.ring_members[k], state.ring_weights[k]
    arm = state.particle_position[members[0]] * weights[0] - origin
    for i in ti.static(range(1, 4)):
        arm += state.particle_position[members[i]] * weights[i]
    return arm


@ti.func
def _voronoi_normal(state: ti.template(), e, center):
    """Twice the area vector of a deformed Voronoi face [m^2] (thesis 4.1).

    The vector is summed over triangles between the edge's centre and two corners of the face.
    """
    total = center * 0.0
    ring = state.edge_ring[e]
    if ring[1] > ring[0]:
        arm = _corner(state, ring[0], center)
        for k in range(ring[0] + 1, ring[1]):
            following = _corner(state, k, center)
            total += arm.cross(following)
            arm = following
    return total


@ti.func
def _subface_normal(state: ti.template(), e, xp, r):
    """Return the area vector of an edge's subfaces [m^2], and the carried direction (see `laws.cmpm2`)."""
    total, carried = r * 0.0, r * 0.0
    ring = state.edge_ring[e]
    for k in range(ring[0], ring[1]):
        members, weights = state.ring_members[k], state.ring_weights[k]
        a, b = state.particle_position[members[0]] - xp, state.particle_position[members[1]] - xp
        total += subface(r * 0.5, a, b)
        carried += a * weights[0] + b * weights[1] + r * weights[2]
    return total, carried


@ti.func
def _fitted_normal(state: ti.template(), e, xp, r):
    """Return the unit normal of the plane that best fits the particles around an edge, and the carried
    direction (see `laws.best_fitting_plane`).
    """
    total, carried = r * 0.0, r * 0.0
    s0, s1, s2 = r * 0.0, r * 0.0, r * 0.0
    ring = state.edge_ring[e]
    for k in range(ring[0], ring[1]):
        arm = state.particle_position[state.ring_members[k][0]] - xp
        carried += arm * state.ring_weights[k][0] + r * state.ring_weights[k][1]
        arm -= r * 0.5
        total += arm
        s0 += arm * arm.x
        s1 += arm * arm.y
        s2 += arm * arm.z
    count = ti.max(ring[1] - ring[0], 3)  # with two particles, the edge's centre is the third point
    return plane_normal(count, total, (s0, s1, s2), r), carried


@ti.func
def _split_normal(state: ti.template(), e, xp, r):
    """Return the normal of a ring that is split twice, and the carried direction.

    `laws.split_ring_plane` describes both. The normal is not normalised.
    """
    one, other, carried = r * 0.0, r * 0.0, r * 0.0
    ring = state.edge_ring[e]
    for k in range(ring[0], ring[1]):
        arm, weights = state.particle_position[state.ring_members[k][0]] - xp, state.ring_weights[k]
        carried += arm * weights[0] + r * weights[1]
        arm -= r * 0.5
        one += arm * weights[2]
        other += arm * weights[3]
    return one.cross(other), carried


@ti.func
def _tilted_normal(state: ti.template(), e, xp, r):
    """Unit normal of the plane that the particles around an edge tilt (thesis 4.4.3)."""
    axis = direction_of(r)
    height = axis.x * 0.0
    ring = state.edge_ring[e]
    for k in range(ring[0], ring[1]):
        height += axis.dot(state.particle_position[state.ring_members[k][0]] - xp)
    height /= ti.max(ring[1] - ring[0], 1)
    rotation = r * 0.0
    for k in range(ring[0], ring[1]):
        arm = state.particle_position[state.ring_members[k][0]] - xp
        rotation += tilt(axis, arm, height, state.ring_weights[k][1], state.ring_weights[k][0])
    return tilted_normal(axis, rotation)


@ti.func
def bond_frame_of(state: ti.template(), law: ti.template(), e):
    """Return the vector from the first to the second end of an edge [m], the unit normal of the edge's plane,
    and the direction that the law compares with the normal.
    """
    xp = state.particle_position[state.edge_vertices[e][0]]
    r = state.particle_position[state.edge_vertices[e][1]] - xp
    normal, compared = r, r
    if ti.static(law.ring == Ring.VORONOI):
        normal = _voronoi_normal(state, e, xp + r * 0.5)
    if ti.static(law.ring == Ring.SUBFACES):
        normal, compared = _subface_normal(state, e, xp, r)
    if ti.static(law.ring == Ring.PLANE):
        normal, compared = _fitted_normal(state, e, xp, r)
    if ti.static(law.ring == Ring.HALVES):
        normal, compared = _split_normal(state, e, xp, r)
    if ti.static(law.ring == Ring.TILT):
        normal = _tilted_normal(state, e, xp, r)
    return r, direction_of(normal), compared


@ti.func
def stored_frame_of(state: ti.template(), law: ti.template(), e):
    """Return the result of `bond_frame_of`.

    With implicit integration, laws with planes read the stored result of the last evaluation of forces.
    """
    if ti.static(not state.capacity.implicit or law.ring == Ring.NONE or law.ring == Ring.EXPANSION):
        return bond_frame_of(state, law, e)
    else:
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        r = state.particle_position[q] - state.particle_position[p]
        return r, state.edge_normal[e], state.edge_compared[e]


@ti.func
def ring_tension(state: ti.template(), e):
    """Pull of the tetrahedra around an edge on the ends of the edge [N], from the stored pressures."""
    pressure = state.edge_damping[e] * 0.0
    ring = state.edge_ring[e]
    for k in range(ring[0], ring[1]):
        pressure += state.tet_pressure[state.ring_members[k][0]]
    return pressure * state.edge_bond[e].z


@ti.func
def bond_force_of(state: ti.template(), law: ti.template(), e):
    """Elastic and damping force on the first end of an edge with a ring [N]."""
    p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
    relative_velocity = state.particle_velocity[q] - state.particle_velocity[p]
    _, n, compared = bond_frame_of(state, law, e)
    if ti.static(state.capacity.implicit):
        state.edge_normal[e], state.edge_compared[e] = n, compared
    constants = state.edge_bond[e]
    return bond_force(compared, n, constants) + bond_damping(
        compared, n, relative_velocity, state.edge_damping[e], constants.w
    )
