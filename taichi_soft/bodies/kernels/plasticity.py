"""Plastic flow: the rest shape of a tetrahedron follows the part of the deformation beyond the yield point.

Flow changes the rest shape A0 to Fp A0. Only the inverse A0^-1 P is stored, in `tet_rest_inverse`; P = Fp^-1
is symmetric, has determinant 1, and is recomputed from the inverse. See `Plasticity`.
"""

from taichi_soft.bodies.status import ACTIVE
from taichi_soft.core.constants import LANES
from taichi_soft.core.math.eigen import from_axes, symmetric_eigen
from taichi_soft.core.math.elementary import exp, exp_each, log_each
from taichi_soft.core.math.tensors import (
    cofactor,
    determinant,
    inner_square,
    outer_square,
    product,
    scaled_plus_identity,
    trace,
    transposed,
)
from taichi_soft.core.math.tetrahedron import shape
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.elastic import particles_of, rest_inverse_of

_ITERATIONS = 12
"""Number of iterations in `_excess`. At twice the yield strain, eight iterations give float32 precision."""

_MAX_STRAIN = 1e6
"""Largest strain with which a tetrahedron flows. A larger strain means that the body is diverging."""


@ti.func
def _original_inverse_of(state: ti.template(), block, lane):
    base = block * 9 * LANES + lane
    a = [state.tet_original_inverse[base + k * LANES] for k in ti.static(range(9))]
    return ti.Vector([a[0], a[1], a[2]]), ti.Vector([a[3], a[4], a[5]]), ti.Vector([a[6], a[7], a[8]])


@ti.func
def _deviator(v):
    return v - v.sum() / 3.0


@ti.func
def _equivalent(v):
    """Return the equivalent strain sqrt(2/3 e:e) of a deviator e, given by its principal values."""
    return ti.sqrt(v.dot(v) * 2.0 / 3.0)


@ti.func
def _excess(logarithms, limit):
    """Return the fraction of the strain deviator that exceeds the yield strain `limit`, 0 to 1.

    Args: logarithms: principal logarithmic strains.
    """
    deviator = _deviator(logarithms)
    mean = logarithms - deviator
    kept = logarithms.x * 0.0 + 1.0
    for _ in range(_ITERATIONS):
        strain = _equivalent(_deviator(0.5 * exp_each(2.0 * (mean + kept * deviator))))
        kept = ti.min(kept * limit / ti.max(strain, 1e-30), 1.0)
    return 1.0 - kept


@ti.func
def _limited(columns, maximum):
    """Return the columns of a symmetric matrix of determinant 1 that has the stretches of a matrix M.

    The equivalent strain is limited to `maximum`. M, with columns `columns`, is a symmetric matrix times a
    rotation. The rotation has no effect in an isotropic material.
    """
    squares, axes = symmetric_eigen(outer_square(columns))
    logarithms = _deviator(0.5 * log_each(ti.max(squares, 1e-30)))
    strain = _equivalent(logarithms)
    return from_axes(exp_each(logarithms * ti.min(1.0, maximum / ti.max(strain, 1e-30))), axes)


@ti.func
def _flow_tet(state: ti.template(), block, lane, plasticity, dt):
    p0, p1, p2, p3 = particles_of(state, block, lane)
    x0, x1 = state.particle_position[p0], state.particle_position[p1]
    B = shape(x0, x1, state.particle_position[p2], state.particle_position[p3])
    inverse = rest_inverse_of(state, block, lane)
    square = inner_square(product(B, inverse))
    shift = scaled_plus_identity(square, 0.5, -trace(square) / 6.0)  # deviator of the strain (C - I) / 2
    strain = ti.sqrt((shift[0].dot(shift[0]) + shift[1].dot(shift[1]) + shift[2].dot(shift[2])) * 2.0 / 3.0)
    shear = state.tet_lame[(block * 2 + 1) * LANES + lane]
    limit = plasticity[1] + plasticity[0] / (3.0 * ti.max(shear, 1e-30))
    if strain > limit and strain < _MAX_STRAIN and determinant(B) > 0.0:
        squares, axes = symmetric_eigen(square)
        logarithms = 0.5 * log_each(ti.max(squares, 1e-12))
        part = _excess(logarithms, limit) * (1.0 - exp(-plasticity[2] * dt))
        flowed = product(inverse, from_axes(exp_each(-part * _deviator(logarithms)), axes))
        original = _original_inverse_of(state, block, lane)
        scale = 1.0 / determinant(original)
        rest = transposed(cofactor(original))  # A0 / scale
        P = _limited(product((rest[0] * scale, rest[1] * scale, rest[2] * scale), flowed), plasticity[3])
        new = product(original, P)
        for column in ti.static(range(3)):
            for i in ti.static(range(3)):
                state.tet_rest_inverse[(block * 9 + 3 * column + i) * LANES + lane] = new[column][i]


@ti.func
def flow_block(state: ti.template(), body, block, dt):
    """Apply plastic flow to the tetrahedra of one block for a duration `dt` [s]."""
    for lane in range(LANES):
        _flow_tet(state, block, lane, state.body_plasticity[body], dt)


@ti.func
def flow_body(state: ti.template(), body, dt):
    """Apply plastic flow to the tetrahedra of one body for a duration `dt` [s], in one thread."""
    if state.body_status[body] == ACTIVE and state.body_plasticity[body][2] > 0.0:
        blocks = state.body_blocks[body]
        for block in range(blocks[0], blocks[1]):
            flow_block(state, body, block, dt)


@ti.func
def restore_shape(state: ti.template(), body):
    """Restore the original rest shape of a body."""
    blocks = state.body_blocks[body]
    for i in range(blocks[0] * 9 * LANES, blocks[1] * 9 * LANES):
        state.tet_rest_inverse[i] = state.tet_original_inverse[i]


@ti.kernel
def read_rest_inverses(state: ti.template(), body: ti.i32, out: ti.types.ndarray(ndim=3)):
    """Write the current A^-1 of each tetrahedron of a body to `out`, (m, 3, 3) [1/m], in kernel order."""
    ti.loop_config(serialize=True)
    for t in range(out.shape[0]):
        block, lane = state.body_blocks[body][0] + t // LANES, t % LANES
        for column in range(3):
            for i in range(3):
                out[t, i, column] = state.tet_rest_inverse[(block * 9 + 3 * column + i) * LANES + lane]
