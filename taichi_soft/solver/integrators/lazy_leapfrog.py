"""Lazy leapfrog (thesis section 3.5.2): explicit Euler with its two lines swapped."""

from taichi_soft.core.runtime import ti


@ti.func
def lazy_leapfrog(x, v, a, h, kick):
    """Position after `h` [s] with the new velocity, which comes first. `kick` is a whole substep [s]."""
    v_new = v + kick * a
    return x + h * v_new, v_new
