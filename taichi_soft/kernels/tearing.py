"""Which bodies may tear: a bound on the stress of every tetrahedron, cheap enough for every step."""

from taichi_soft.constants import LANES
from taichi_soft.kernels.elastic import particles_of, rest_inverse_of
from taichi_soft.laws.hooke import hooke_stress
from taichi_soft.math.tensors import inner_square, product, scaled_plus_identity, trace
from taichi_soft.math.tetrahedron import shape
from taichi_soft.runtime import ti
from taichi_soft.state import ACTIVE


@ti.func
def _pull_bound(state: ti.template(), block, lane):
    """At least the largest principal stress of a tetrahedron [Pa]; it itself in a pull along one axis."""
    p0, p1, p2, p3 = particles_of(state, block, lane)
    x0, x1 = state.particle_position[p0], state.particle_position[p1]
    B = shape(x0, x1, state.particle_position[p2], state.particle_position[p3])
    green = scaled_plus_identity(inner_square(product(B, rest_inverse_of(state, block, lane))), 0.5, -0.5)
    base = block * 2 * LANES + lane
    stress = hooke_stress(green, state.tet_lame[base], state.tet_lame[base + LANES])
    mean = trace(stress) / 3.0
    d = scaled_plus_identity(stress, 1.0, -mean)
    return mean + ti.sqrt((d[0].dot(d[0]) + d[1].dot(d[1]) + d[2].dot(d[2])) * 2.0 / 3.0)


@ti.kernel
def find_overloaded(
    state: ti.template(),
    limits: ti.types.ndarray(dtype=ti.f32, ndim=1),
    found: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Mark with 1 each body of which a tetrahedron may bear more than the body's limit [Pa]; 0 for none."""
    for body in range(limits.shape[0]):
        result = 0
        if limits[body] > 0.0 and state.body_status[body] == ACTIVE:
            blocks = state.body_blocks[body]
            for t in range(blocks[0] * LANES, blocks[1] * LANES):
                if _pull_bound(state, t // LANES, t % LANES) > limits[body]:
                    result = 1
        found[body] = result
