"""Forces that brake motion inside a body."""

from taichi_soft.runtime import ti


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


@ti.func
def tet_edge_damping_forces(x, v, damping):
    """Forces on four vertices that brake the six edges between them [N]; they sum to zero.

    Args:
        x, v: four positions [m] and velocities [m/s].
        damping: b of each edge [N s/m].
    """
    e01 = edge_damping_force(x[1] - x[0], v[1] - v[0], damping)
    e02 = edge_damping_force(x[2] - x[0], v[2] - v[0], damping)
    e03 = edge_damping_force(x[3] - x[0], v[3] - v[0], damping)
    e12 = edge_damping_force(x[2] - x[1], v[2] - v[1], damping)
    e13 = edge_damping_force(x[3] - x[1], v[3] - v[1], damping)
    e23 = edge_damping_force(x[3] - x[2], v[3] - v[2], damping)
    return e01 + e02 + e03, e12 + e13 - e01, e23 - e02 - e12, -e03 - e13 - e23
