"""Find overloaded bodies after every step, by a cheap upper bound on the stress of each tetrahedron."""

from taichi_soft.bodies.status import ACTIVE
from taichi_soft.core.constants import LANES
from taichi_soft.core.math.tensors import scaled_plus_identity, trace
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.stress import stress_of


@ti.func
def _pull_bound(state: ti.template(), model: ti.template(), block, lane):
    """Return an upper bound on the largest principal stress of a tetrahedron [Pa].

    The bound is exact for uniaxial tension.
    """
    stress = stress_of(state, model, block, lane)
    mean = trace(stress) / 3.0
    d = scaled_plus_identity(stress, 1.0, -mean)
    return mean + ti.sqrt((d[0].norm_sqr() + d[1].norm_sqr() + d[2].norm_sqr()) * 2.0 / 3.0)


@ti.func
def _is_overloaded(state: ti.template(), model: ti.template(), body, limit):
    result = 0
    blocks = state.body_blocks[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        if _pull_bound(state, model, t // LANES, t % LANES) > limit:
            result = 1
    return result


@ti.kernel
def find_overloaded(
    state: ti.template(),
    program: ti.template(),
    limits: ti.types.ndarray(dtype=ti.f32, ndim=1),
    found: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Find the bodies in which the stress of a tetrahedron can exceed the body's limit.

    Args:
        limits: largest stress of each body [Pa], 0 for a body that is not checked.
        found: receives 1 for an overloaded body, else 0.
    """
    for body in range(limits.shape[0]):
        result = 0
        if limits[body] > 0.0 and state.body_status[body] == ACTIVE:
            for m, model in ti.static(enumerate(program.models)):
                if state.body_model[body] == m:
                    result = _is_overloaded(state, model, body, limits[body])
        found[body] = result
