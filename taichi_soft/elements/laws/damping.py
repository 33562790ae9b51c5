"""Forces that brake motion inside a body."""

from taichi_soft.core.runtime import ti


@ti.func
def edge_damping_force(r, relative_velocity, damping):
    """Force on the first end of an edge [N]; the second end feels the opposite (thesis eq. 3.9).

    Only the part along the edge is braked, so a body that turns or flies as a whole keeps its motion.
    An edge of no length has no direction and is not braked.
    Args:
        r: second end minus first end [m].
        relative_velocity: velocity of the second end minus that of the first [m/s].
        damping: b [N s/m].
    """
    # (n.dv) n with n = r / |r| needs no root: the two lengths meet in one quotient.
    return r * (damping * r.dot(relative_velocity) / (r.dot(r) + 1e-30))


@ti.func
def tet_mean_damping_forces(v0, v1, v2, v3, damping):
    """Forces that pull four vertices towards their mean velocity [N]; they sum to zero.

    Thesis section 6.4 tries and rejects this model: it brakes rotation as well.
    """
    mean = (v0 + v1 + v2 + v3) / 4.0
    return damping * (mean - v0), damping * (mean - v1), damping * (mean - v2), damping * (mean - v3)
