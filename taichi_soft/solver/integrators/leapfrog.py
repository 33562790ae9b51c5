"""Leapfrog (thesis section 3.5.2, eq. 3.17 with v_3/2 = v_1/2 + h M^-1 f(x_1)).

Velocities live half a substep behind positions. `kick` is the time from the velocity's last moment to
the middle of the coming substep: h in a steady run, h / 2 from a fresh start, where the velocity
belongs to the same moment as the position, and (h_old + h) / 2 where the substep changes.
"""

from taichi_soft.core.runtime import ti


@ti.func
def leapfrog(x, v, a, h, kick):
    """Position one substep later, velocity half a substep ahead of where the position was."""
    v_new = v + kick * a
    return x + h * v_new, v_new
