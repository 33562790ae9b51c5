"""Lazy leapfrog (thesis section 3.5.2): explicit Euler with its two lines swapped."""

from taichi_soft.core.runtime import ti


@ti.func
def lazy_leapfrog(x, v, a, h, kick):
    """Position and velocity one substep later: velocity first, position with the new velocity."""
    v_new = v + h * a
    return x + h * v_new, v_new
