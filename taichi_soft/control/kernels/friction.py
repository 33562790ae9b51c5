"""Change the friction of bodies between two steps."""

from taichi_soft.core.runtime import ti


@ti.kernel
def write_friction(state: ti.template(), body: ti.i32, friction: ti.f32):
    """Write the Coulomb coefficient of one body in contact with other bodies."""
    state.body_surface[body][0] = friction
