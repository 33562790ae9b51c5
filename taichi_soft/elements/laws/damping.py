"""Damping forces within a body."""

from taichi_soft.core.runtime import ti


@ti.func
def edge_damping_force(r, relative_velocity, damping):
    """Damping force on the first end of an edge [N] (thesis eq. 3.9).

    The opposite force acts on the second end. The force damps only motion along the edge, so a body that
    rotates or translates rigidly keeps its motion. An edge of zero length has no direction and no damping.
    Args:
        r: second end minus first end [m].
        relative_velocity: velocity of the second end relative to the first [m/s].
        damping: b [N s/m].
    """
    # (n.dv) n with n = r / |r| is r (r.dv) / |r|^2, which needs no square root.
    return r * (damping * r.dot(relative_velocity) / (r.dot(r) + 1e-30))


@ti.func
def tet_mean_damping_forces(v0, v1, v2, v3, damping):
    """Forces that drive four vertices towards their mean velocity [N]; they sum to zero.

    Thesis section 6.4 tests and rejects this model, because it also damps rotation.
    """
    mean = (v0 + v1 + v2 + v3) / 4.0
    return damping * (mean - v0), damping * (mean - v1), damping * (mean - v2), damping * (mean - v3)
