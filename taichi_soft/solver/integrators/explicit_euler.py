"""Explicit Euler (thesis section 3.5.1, eq. 3.16). Gains energy on every oscillation; for comparison."""

from taichi_soft.core.runtime import ti


@ti.func
def explicit_euler(x, v, a, h, kick):
    """Position and velocity one substep later, both from the old values."""
    return x + h * v, v + h * a
