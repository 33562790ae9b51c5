"""Stress of tetrahedra where they are now: for those who watch it step by step."""

from taichi_soft.core.constants import LANES
from taichi_soft.core.math.eigen import symmetric_eigen
from taichi_soft.core.math.tensors import (
    determinant,
    inner_square,
    plus,
    product,
    scaled_plus_identity,
    times,
    trace,
)
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.elastic import BLOCK_BITS, particles_of, rest_inverse_of, stiffness_of
from taichi_soft.elements.laws.anisotropy import anisotropic_stress
from taichi_soft.elements.laws.hooke import hooke_stress

NO_LIMIT = 1e30
"""[Pa]; infinity would not do, because fast-math compilers may assume that there is none."""


@ti.func
def deformation_of(state: ti.template(), block, lane):
    """F of a tetrahedron, as columns."""
    p0, p1, p2, p3 = particles_of(state, block, lane)
    x0 = state.particle_position[p0]
    a, b, c = state.particle_position[p1], state.particle_position[p2], state.particle_position[p3]
    return product((a - x0, b - x0, c - x0), rest_inverse_of(state, block, lane))


@ti.func
def stress_of(state: ti.template(), F, block, lane):
    """Hooke's stress of 1/2 (F^T F - I) [Pa], as columns, in the axes of the rest shape."""
    strain = scaled_plus_identity(inner_square(F), 0.5, -0.5)
    base = block * 2 * LANES + lane
    isotropic = hooke_stress(strain, state.tet_lame[base], state.tet_lame[base + LANES])
    if ti.static(state.capacity.anisotropic):  # one of the two has no constants but zeros
        return plus(isotropic, 1.0, anisotropic_stress(strain, stiffness_of(state, block, lane)), 1.0)
    else:
        return isotropic


@ti.func
def _largest_principal(mean, squares, determinant):
    """Largest eigenvalue of mean I + D, by the angle of the cubic's roots, to 1e-4 of the norm of D.

    Args:
        squares, determinant: D : D, and det D, of D without trace.
    """
    radius = ti.sqrt(squares / 6.0)
    cosine = 0.5 * determinant / ti.max(radius * radius * radius, 1e-30)
    return mean + 2.0 * radius * ti.cos(ti.acos(ti.max(ti.min(cosine, 1.0), -1.0)) / 3.0)


@ti.kernel
def read_stress(
    state: ti.template(),
    blocks: ti.types.ndarray(dtype=ti.i32, ndim=1),
    limits: ti.types.ndarray(dtype=ti.f32, ndim=1),
    out: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Von Mises stress of the tetrahedra in `blocks`; and how hard they are pulled, and in which direction.

    Args:
        limits: for each block, from which pull on the direction is wanted [Pa]; `NO_LIMIT` asks for no pull.
        out: (blocks times `LANES`, 5): von Mises and largest principal stress [Pa]; where that is over the
            limit its direction in the world, of length 1.
    """
    for i in range(blocks.shape[0]):
        block = blocks[i] & BLOCK_BITS
        means, squares = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
        determinants = ti.Vector.zero(state.real, LANES)
        for lane in range(LANES):  # vector registers take all of them at once, see `elements.kernels.elastic`
            stress = stress_of(state, deformation_of(state, block, lane), block, lane)
            means[lane] = trace(stress) / 3.0
            deviator = scaled_plus_identity(stress, 1.0, -means[lane])
            squares[lane] = deviator[0].norm_sqr() + deviator[1].norm_sqr() + deviator[2].norm_sqr()
            determinants[lane] = determinant(deviator)
        for lane in range(LANES):
            row = i * LANES + lane
            out[row, 0] = ti.sqrt(1.5 * squares[lane])
            if limits[i] < NO_LIMIT:
                out[row, 1] = _largest_principal(means[lane], squares[lane], determinants[lane])
                if out[row, 1] > limits[i]:
                    F = deformation_of(state, block, lane)
                    values, axes = symmetric_eigen(stress_of(state, F, block, lane))
                    # F carries an axis of a stretch to where that stretch is now; of others it comes near.
                    along = times(F, axes[0]).normalized(1e-30)
                    out[row, 1] = values[0]
                    for k in ti.static(range(3)):
                        out[row, 2 + k] = along[k]
