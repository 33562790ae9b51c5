"""Clear the loads of a body on frames, grabs and joints.

Groups of fields: writes grabs, joints.
"""

from taichi_soft.control.kernels.grabs import MOST_GRABS
from taichi_soft.control.kernels.joints import ENDS, MOST_JOINTS
from taichi_soft.core.runtime import ti


@ti.func
def forget_loads(state: ti.template(), body):
    """Clear the loads of a step that was undone because the body failed. These loads can be NaN."""
    zero = ti.Vector.zero(state.real, 3)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        state.particle_reaction[p] = zero
        if ti.static(state.capacity.rods):
            state.rod_reaction[p] = zero
    for g in range(MOST_GRABS):
        if state.grabs.body[g] == body + 1:
            state.grabs.force[g] = zero
    if ti.static(state.capacity.has_contact):
        for j in range(MOST_JOINTS):
            ends, rows = state.joints.bodies[j], state.joints.rows[j]
            if ends[0] == body + 1 or ends[1] == body + 1:
                state.joints.impulse[j] = zero
                for r in range(rows[0], rows[1]):
                    state.joints.row_impulse[r] = zero
                    for k in range(r * ENDS, (r + 1) * ENDS):
                        state.joints.share[k] = state.joints.weight[k]
