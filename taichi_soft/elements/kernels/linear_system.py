"""System matrix of implicit Euler, M + h D + h^2 K (eq. 3.26), in 3x3 blocks for each particle and edge.

K = - df/dx and D = - df/dv are both projected to be positive semi-definite. Only particles that share an edge
interact, so every law fills the same blocks, and a product with the matrix is one pass over the edges. The
rows of K and D sum to zero, so a product needs only `particle_inertia` and the velocity differences along
edges. A product with the diagonal blocks would be less exact: if all particles have the same velocity, the
large products of blocks and velocities would cancel and leave only rounding errors. Only the preconditioner
uses the diagonal blocks.
"""

from taichi_soft.core.constants import LANES
from taichi_soft.core.math.tensors import outer, product
from taichi_soft.core.math.tetrahedron import shape
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import DampingModel
from taichi_soft.elements.kernels.bonds import ring_tension, stored_frame_of
from taichi_soft.elements.kernels.elastic import elasticity_of, particles_of, rest_inverse_of
from taichi_soft.elements.laws.anisotropic_stiffness import (
    fixed_rotation_stiffness,
    pair_stiffness,
    rotating_pair_stiffness,
)
from taichi_soft.elements.laws.anisotropy import green_stress
from taichi_soft.elements.laws.bond_stiffness import along_and_across, spring_stiffness
from taichi_soft.elements.laws.bonds import Ring
from taichi_soft.elements.laws.cmpm import direction_of, shear_direction
from taichi_soft.elements.laws.force_gradients import (
    element_stiffness,
    positive_part,
    stiffness_block,
    weighted_rows,
)
from taichi_soft.elements.laws.springs import along, spring_tension
from taichi_soft.elements.laws.volume_springs import expansion_gradients

EDGES = ((0, 0, 1), (1, 0, 2), (2, 0, 3), (3, 1, 2), (4, 1, 3), (5, 2, 3))
"""The six edges of a tetrahedron. Each entry has the index of the edge in `state.tet_edges`, the first corner
and the second corner."""


@ti.func
def clear_system(state: ti.template(), body):
    """Set all blocks of one body to zero."""
    particles, edges = state.body_particles[body], state.body_edges[body]
    for p in range(particles[0], particles[1]):
        state.particle_block[p] = ti.Matrix.zero(state.real, 3, 3)
        state.particle_inertia[p] = 0.0
    for e in range(edges[0], edges[1]):
        state.edge_block[e] = ti.Matrix.zero(state.real, 3, 3)


@ti.func
def _add_pair(state: ti.template(), e, columns):
    """Add a matrix to the blocks of both ends of an edge, and subtract it from the block of the edge."""
    block = ti.Matrix.cols([columns[0], columns[1], columns[2]])
    p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
    state.particle_block[p] = state.particle_block[p] + block
    state.particle_block[q] = state.particle_block[q] + block
    state.edge_block[e] = state.edge_block[e] - block


@ti.func
def _add_corner_pair(state: ti.template(), e, first, columns):
    """Add a tetrahedron's block for two corners to their edge. The block's rows are for particle `first`."""
    block = ti.Matrix.cols([columns[0], columns[1], columns[2]])
    if state.edge_vertices[e][0] != first:
        block = block.transpose()
    state.edge_block[e] = state.edge_block[e] + block


@ti.func
def tet_stiffness(state: ti.template(), model: ti.template(), block, lane, projected: ti.template()):
    """Compute arguments of `corner_stiffness` for a tetrahedron: rows of the four corners, and `element`.

    Args:
        projected: True makes the stiffness symmetric and positive semi-definite.
    """
    v = particles_of(state, block, lane)
    x = [state.particle_position[v[i]] for i in ti.static(range(4))]
    inverse = rest_inverse_of(state, block, lane)
    F = product(shape(x[0], x[1], x[2], x[3]), inverse)
    elasticity = elasticity_of(state, model, block, lane)
    if ti.static(model.is_anisotropic and not model.has_energy):
        if ti.static(projected):
            M, tension = fixed_rotation_stiffness(model, F, elasticity)
            return weighted_rows(inverse), (M, tension, elasticity)
        else:
            return weighted_rows(inverse), (F, F, elasticity)
    elif ti.static(model.is_anisotropic):
        a, b, c = green_stress(F, elasticity)
        if ti.static(projected):
            a, b, c = positive_part((a, b, c))
        return weighted_rows(inverse), (F, (a, b, c), elasticity)
    else:
        return element_stiffness(model, F, weighted_rows(inverse), elasticity, projected)


@ti.func
def corner_stiffness(model: ti.template(), gi, gj, element, projected: ti.template()):
    """Negative derivative of the force on corner i with respect to the position of corner j.

    Args:
        gi, gj, element: rows of the two corners, and `element`, from `tet_stiffness`.
    Returns: columns [N/m].
    """
    if ti.static(model.is_anisotropic and not model.has_energy and not projected):
        return rotating_pair_stiffness(model, element[0], gi, gj, element[2])
    elif ti.static(model.is_anisotropic):
        return pair_stiffness(element[0], gi, gj, element[1], element[2])
    else:
        return stiffness_block(element[0], gi, gj, element[1], element[2], element[3])


@ti.func
def row_of(rows, i):
    """Row i of a matrix (4, 3), as a vec3. The index i can be unknown at compile time."""
    return ti.Vector([rows[i, 0], rows[i, 1], rows[i, 2]])


@ti.func
def _add_tet_stiffness(state: ti.template(), model: ti.template(), body, scale):
    blocks = state.body_blocks[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        block, lane = t // LANES, t % LANES
        g, element = tet_stiffness(state, model, block, lane, True)
        # The loops over pairs of corners are not unrolled: ten copies would dominate the compile time.
        rows = ti.Matrix.rows([g[0], g[1], g[2], g[3]])
        for i in range(4):
            p = state.tet_vertices[(block * 4 + i) * LANES + lane]
            for j in range(i, 4):
                c0, c1, c2 = corner_stiffness(model, row_of(rows, i), row_of(rows, j), element, True)
                if i == j:
                    state.particle_block[p] = state.particle_block[p] + ti.Matrix.cols([c0, c1, c2]) * scale
                else:
                    k = i * (5 - i) // 2 + j - 1  # index of the edge in `EDGES`
                    e = state.tet_edges[(block * 6 + k) * LANES + lane]
                    _add_corner_pair(state, e, p, (c0 * scale, c1 * scale, c2 * scale))


@ti.func
def volume_pull(state: ti.template(), t):
    """Return the gradients g of V / V0 [1/m] and the vectors w [N] of the corners of a tetrahedron.

    The force on a corner is -w dV / V0. The stiffness is therefore the outer product of w and g.
    """
    block, lane = t // LANES, t % LANES
    v = particles_of(state, block, lane)
    x = [state.particle_position[v[i]] for i in ti.static(range(4))]
    g = expansion_gradients(x[0], x[1], x[2], x[3], state.tet_inverse_volume6[t])
    area = [state.edge_bond[state.tet_edges[(block * 6 + k) * LANES + lane]].z for k in ti.static(range(6))]
    f = [along(x[j] - x[i], state.tet_expansion_modulus[t] * area[k]) for k, i, j in ti.static(EDGES)]
    w = -(f[0] + f[1] + f[2]), f[0] - f[3] - f[4], f[1] + f[3] - f[5], f[2] + f[4] + f[5]
    return g, w


@ti.func
def _add_volume_stiffness(state: ti.template(), body, scale):
    """Add the stiffness of tetrahedra that pull the ends of their edges together.

    The stiffness of a tetrahedron is w g^T (`volume_pull`). This function adds only the positive part. The
    symmetric part of w g^T has the eigenvalues (w.g +- |w||g|) / 2. The positive eigenvalue belongs to the
    direction w/|w| + g/|g|.
    """
    blocks = state.body_blocks[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        block, lane = t // LANES, t % LANES
        v = particles_of(state, block, lane)
        g, w = volume_pull(state, t)
        ww = w[0].dot(w[0]) + w[1].dot(w[1]) + w[2].dot(w[2]) + w[3].dot(w[3])
        gg = g[0].dot(g[0]) + g[1].dot(g[1]) + g[2].dot(g[2]) + g[3].dot(g[3])
        # |w/|w| + g/|g||^2 = 2 + 2 w.g / (|w||g|): the positive part is `strength` times its outer square.
        strength = 0.25 * scale * ti.sqrt(ww * gg)
        if strength > 0.0:
            a, b = 1.0 / ti.sqrt(ww), 1.0 / ti.sqrt(gg)
            u = [w[i] * a + g[i] * b for i in ti.static(range(4))]
            for i in ti.static(range(4)):
                own = outer(u[i] * strength, u[i])
                state.particle_block[v[i]] = state.particle_block[v[i]] + ti.Matrix.cols(
                    [own[0], own[1], own[2]]
                )
            for k, i, j in ti.static(EDGES):
                e = state.tet_edges[(block * 6 + k) * LANES + lane]
                _add_corner_pair(state, e, v[i], outer(u[i] * strength, u[j]))


@ti.func
def bond_stiffness(state: ti.template(), law: ti.template(), e, projected: ti.template()):
    """Negative derivative of the force on a bond's first end with respect to the position of this end.

    The normal of the bond is fixed. The derivative with respect to the position of the second end is the
    opposite.
    Returns: columns [N/m].
    """
    r, n, _ = stored_frame_of(state, law, e)
    constants = state.edge_bond[e]
    if ti.static(law.ring == Ring.NONE or law.ring == Ring.EXPANSION):
        tension = spring_tension(r, constants)
        if ti.static(law.ring == Ring.EXPANSION):
            tension += ring_tension(state, e)
        return spring_stiffness(r, tension, constants, projected)
    else:
        # The constants of laws that compare directions are for an edge of length 1.
        per_length = constants.x * 0.0 + 1.0
        if ti.static(law.ring in (Ring.SUBFACES, Ring.PLANE, Ring.HALVES)):
            per_length = 1.0 / ti.max(ti.sqrt(r.dot(r)), 1e-15)
        return along_and_across(n, constants.y * per_length, constants.z * per_length)


@ti.func
def _add_bond_stiffness(state: ti.template(), law: ti.template(), body, scale):
    if ti.static(law.ring == Ring.EXPANSION):
        _add_volume_stiffness(state, body, scale)
    edges = state.body_edges[body]
    for e in range(edges[0], edges[1]):
        c0, c1, c2 = bond_stiffness(state, law, e, True)
        _add_pair(state, e, (c0 * scale, c1 * scale, c2 * scale))


@ti.func
def add_stiffness(state: ti.template(), program: ti.template(), body, scale):
    """Add `scale` times the projected stiffness of one body to its blocks."""
    for m, model in ti.static(enumerate(program.models)):
        if state.body_model[body] == m:
            if ti.static(model.has_bonds):
                _add_bond_stiffness(state, model.law, body, scale)
            else:
                _add_tet_stiffness(state, model, body, scale)


@ti.func
def bond_damping_matrix(state: ti.template(), law: ti.template(), e):
    """Negative derivative of the damping force on an edge's first end with respect to this end's velocity.

    Returns: columns [N s/m].
    """
    _, n, compared = stored_frame_of(state, law, e)
    zero = state.edge_damping[e] * 0.0
    c0, c1, c2 = along_and_across(n, state.edge_damping[e], zero)
    if ti.static(not (law.ring == Ring.NONE or law.ring == Ring.EXPANSION)):
        m = shear_direction(compared, n)
        m0, m1, m2 = along_and_across(m, state.edge_bond[e].w, zero)
        c0, c1, c2 = c0 + m0, c1 + m1, c2 + m2
    return c0, c1, c2


@ti.func
def _add_edge_damping(state: ti.template(), body, scale):
    edges = state.body_edges[body]
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        n = direction_of(state.particle_position[q] - state.particle_position[p])
        b = state.edge_damping[e] * scale
        _add_pair(state, e, along_and_across(n, b, b * 0.0))


@ti.func
def _add_tet_damping(state: ti.template(), body, scale):
    """Add `scale` times the damping of each tetrahedron: `tet_damping` / 4 between each pair of corners."""
    blocks = state.body_blocks[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        block, lane = t // LANES, t % LANES
        quarter = 0.25 * scale * state.tet_damping[block * LANES + lane]
        if quarter > 0.0:
            x_axis = state.particle_position[particles_of(state, block, lane)[0]] * 0.0
            c0, c1, c2 = along_and_across(x_axis, quarter, quarter)
            for k in ti.static(range(6)):
                _add_pair(state, state.tet_edges[(block * 6 + k) * LANES + lane], (c0, c1, c2))


@ti.func
def add_damping(state: ti.template(), program: ti.template(), body, scale):
    """Add `scale` times the damping matrix of one body to its blocks."""
    for m, model in ti.static(enumerate(program.models)):
        if state.body_model[body] == m:
            if ti.static(model.has_bonds):
                edges = state.body_edges[body]
                for e in range(edges[0], edges[1]):
                    c0, c1, c2 = bond_damping_matrix(state, model.law, e)
                    _add_pair(state, e, (c0 * scale, c1 * scale, c2 * scale))
            elif ti.static(model.damping_model == DampingModel.EDGE):
                _add_edge_damping(state, body, scale)
            else:
                _add_tet_damping(state, body, scale)


@ti.func
def add_inertia(state: ti.template(), p, inertia):
    """Add `inertia` [kg] to a particle. The inertia resists any change of the particle's velocity."""
    state.particle_inertia[p] = state.particle_inertia[p] + inertia
    for i in ti.static(range(3)):
        state.particle_block[p][i, i] = state.particle_block[p][i, i] + inertia


@ti.func
def add_masses(state: ti.template(), body):
    """Add the masses of one body to its diagonal blocks, except for pinned particles."""
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        inv_mass = state.particle_inv_mass[p]
        if inv_mass > 0.0:
            add_inertia(state, p, 1.0 / inv_mass)


@ti.func
def add_edge_products(state: ti.template(), body, source: ti.template(), target: ti.template()):
    """Multiply the edge blocks (K and D) of one body by `source`, and add the product to `target`."""
    edges = state.body_edges[body]
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        block, difference = state.edge_block[e], source[q] - source[p]
        target[p] = target[p] + block @ difference
        target[q] = target[q] - block.transpose() @ difference
