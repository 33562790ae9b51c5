"""Stress of tetrahedra where they are now: for those who watch it step by step."""

from taichi_soft.constants import LANES
from taichi_soft.kernels.elastic import particles_of, rest_inverse_of, stiffness_of
from taichi_soft.laws.anisotropy import green_stress
from taichi_soft.laws.hooke import hooke_stress
from taichi_soft.math.eigen import symmetric_eigen
from taichi_soft.math.tensors import inner_square, plus, product, scaled_plus_identity, times, trace
from taichi_soft.runtime import ti


@ti.func
def _stress_of(state: ti.template(), F, block, lane):
    """Hooke's stress of 1/2 (F^T F - I) [Pa], as columns, in the axes of the rest shape."""
    constants = state.tet_lame[block * 2 * LANES + lane], state.tet_lame[(block * 2 + 1) * LANES + lane]
    stress = hooke_stress(scaled_plus_identity(inner_square(F), 0.5, -0.5), constants[0], constants[1])
    if ti.static(state.capacity.anisotropic):  # one of the two has no constants but zeros
        stress = plus(stress, 1.0, green_stress(F, stiffness_of(state, block, lane)), 1.0)
    return stress


@ti.kernel
def read_stress(
    state: ti.template(),
    wants_axes: ti.i32,
    blocks: ti.types.ndarray(dtype=ti.i32, ndim=1),
    out: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Von Mises stress of the tetrahedra in `blocks`; where wanted also how hard they are pulled, and along.

    Args:
        out: (blocks times `LANES`, 5): von Mises and largest principal stress [Pa], and the direction of the
            latter in the world, of length 1.
    """
    for i in range(blocks.shape[0]):
        for lane in range(LANES):
            block, row = blocks[i], i * LANES + lane
            p0, p1, p2, p3 = particles_of(state, block, lane)
            x0 = state.particle_position[p0]
            B = (
                state.particle_position[p1] - x0,
                state.particle_position[p2] - x0,
                state.particle_position[p3] - x0,
            )
            F = product(B, rest_inverse_of(state, block, lane))
            stress = _stress_of(state, F, block, lane)
            deviator = scaled_plus_identity(stress, 1.0, -trace(stress) / 3.0)
            squares = deviator[0].norm_sqr() + deviator[1].norm_sqr() + deviator[2].norm_sqr()
            out[row, 0] = ti.sqrt(1.5 * squares)
            if wants_axes == 1:
                values, axes = symmetric_eigen(stress)
                # F carries an axis of a stretch to where that stretch is now; of other axes it comes near.
                along = times(F, axes[0])
                along = along / ti.max(along.norm(), 1e-30)
                out[row, 1] = values[0]
                for k in ti.static(range(3)):
                    out[row, 2 + k] = along[k]
