"""Kernels for the stress of tetrahedra, at their current positions or for an array of deformations."""

from taichi_soft.core.constants import LANES
from taichi_soft.core.math.eigen import symmetric_eigen
from taichi_soft.core.math.elementary import acos, cos_sin
from taichi_soft.core.math.tensors import determinant, product, scaled_plus_identity, trace
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.elastic import BLOCK_BITS, elasticity_of, particles_of, rest_inverse_of
from taichi_soft.elements.laws.force_model import cauchy_stress

NO_LIMIT = 1e30
"""Limit of stress that no stress exceeds [Pa]. It is not infinity, because fast-math compilers assume that
infinity does not occur."""


@ti.func
def deformation_of(state: ti.template(), block, lane):
    """Deformation gradient F of a tetrahedron, as columns."""
    p0, p1, p2, p3 = particles_of(state, block, lane)
    x0 = state.particle_position[p0]
    a, b, c = state.particle_position[p1], state.particle_position[p2], state.particle_position[p3]
    return product((a - x0, b - x0, c - x0), rest_inverse_of(state, block, lane))


@ti.func
def stress_of(state: ti.template(), model: ti.template(), block, lane):
    """`cauchy_stress` of a tetrahedron [Pa], as columns."""
    F = deformation_of(state, block, lane)
    return cauchy_stress(model, F, elasticity_of(state, model, block, lane))


@ti.func
def _largest_principal(mean, squares, determinant):
    """Largest eigenvalue of mean I + D, from the trigonometric formula for cubics.

    The error is 1e-4 of the norm of D.

    Args:
        squares: D : D of the traceless matrix D.
        determinant: det D.
    """
    radius = ti.sqrt(squares / 6.0)
    cosine = 0.5 * determinant / ti.max(radius * radius * radius, 1e-30)
    third, _ = cos_sin(acos(ti.max(ti.min(cosine, 1.0), -1.0)) / 3.0)
    return mean + 2.0 * radius * third


@ti.func
def _read_block(state: ti.template(), model: ti.template(), block, limit, first, out: ti.template()):
    """Write the rows of `read_stress` for the tetrahedra of a block, from row `first` of `out` on."""
    means, squares = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    determinants = ti.Vector.zero(state.real, LANES)
    for lane in range(LANES):  # vectorised over the lanes, see `elements.kernels.elastic`
        stress = stress_of(state, model, block, lane)
        means[lane] = trace(stress) / 3.0
        deviator = scaled_plus_identity(stress, 1.0, -means[lane])
        squares[lane] = deviator[0].norm_sqr() + deviator[1].norm_sqr() + deviator[2].norm_sqr()
        determinants[lane] = determinant(deviator)
    for lane in range(LANES):
        row = first + lane
        out[row, 0] = ti.sqrt(1.5 * squares[lane])
        if limit < NO_LIMIT:
            out[row, 1] = _largest_principal(means[lane], squares[lane], determinants[lane])
            if out[row, 1] > limit:
                values, axes = symmetric_eigen(stress_of(state, model, block, lane))
                out[row, 1] = values[0]
                for k in ti.static(range(3)):
                    out[row, 2 + k] = axes[0][k]


@ti.kernel
def read_stress(
    state: ti.template(),
    program: ti.template(),
    blocks: ti.types.ndarray(dtype=ti.i32, ndim=1),
    limits: ti.types.ndarray(dtype=ti.f32, ndim=1),
    out: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Write the von Mises stress and the largest principal stress of the tetrahedra in `blocks`.

    Args:
        limits: for each block, principal stress [Pa] above which its direction is also written; `NO_LIMIT`
            skips the principal stress.
        out: one row per tetrahedron, (blocks times `LANES`, 5): von Mises stress [Pa], largest principal
            stress [Pa] and, if the principal stress is above the limit, a unit vector along it in world axes.
    """
    for i in range(blocks.shape[0]):
        block = blocks[i] & BLOCK_BITS
        body = state.particle_body[state.tet_vertices[block * 4 * LANES]]
        for m, model in ti.static(enumerate(program.models)):
            if state.body_model[body] == m:
                _read_block(state, model, block, limits[i], i * LANES, out)


@ti.func
def _columns_of(matrices: ti.template(), t, row: ti.template(), column: ti.template()):
    """Return the 3x3 part of matrix `t` that begins at a row and a column, as columns."""
    a = ti.Vector([matrices[t, row + i, column] for i in ti.static(range(3))])
    b = ti.Vector([matrices[t, row + i, column + 1] for i in ti.static(range(3))])
    c = ti.Vector([matrices[t, row + i, column + 2] for i in ti.static(range(3))])
    return a, b, c


@ti.func
def _elasticity_from(model: ti.template(), stiffness: ti.template(), t):
    """Return the elasticity that belongs to stiffness matrix `t`, in the form of `elasticity_of`."""
    if ti.static(model.is_anisotropic):
        normal, mixed = _columns_of(stiffness, t, 0, 0), _columns_of(stiffness, t, 0, 3)
        return normal, mixed, _columns_of(stiffness, t, 3, 3)
    else:
        return stiffness[t, 0, 1], stiffness[t, 5, 5]


@ti.kernel
def compute_stress(
    model: ti.template(),
    deformations: ti.types.ndarray(dtype=ti.f64, ndim=3),
    stiffness: ti.types.ndarray(dtype=ti.f64, ndim=3),
    out: ti.types.ndarray(dtype=ti.f64, ndim=3),
):
    """Write the `cauchy_stress` of m deformation gradients F to `out`, (m, 3, 3) [Pa], in float64.

    Args:
        deformations: deformation gradients F, (m, 3, 3).
        stiffness: matrices like `Stiffness.matrix`, (m, 6, 6) [Pa].
    """
    for t in range(deformations.shape[0]):
        F = _columns_of(deformations, t, 0, 0)
        stress = cauchy_stress(model, F, _elasticity_from(model, stiffness, t))
        for i, k in ti.static(ti.ndrange(3, 3)):
            out[t, i, k] = stress[k][i]
