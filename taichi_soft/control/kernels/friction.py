"""Friction between bodies, written anew between two steps."""

from taichi_soft.core.runtime import ti


@ti.kernel
def write_friction(state: ti.template(), body: ti.i32, friction: ti.f32):
    """Coulomb's coefficient of one body against others."""
    state.soft.body_surface[body][0] = friction
