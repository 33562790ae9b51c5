"""Contacts between edges: sharp edges of solids, edges of sheets, and ropes.

Two edges of solids touch only where each is the nearest part of its body: the contact normal lies between the
normals of the two triangles at the edge. Elsewhere, a vertex touches a triangle.

Sheets and ropes have no inside. Their edges stay on the side on which the search found them.

Groups of fields: writes soft.
"""

from taichi_soft.bodies.contact_edges import OF_ROPE
from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.contact.kernels.features import edge_of
from taichi_soft.contact.kernels.near_candidates import contact_range
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.math.segment import closest_points_on_segments
from taichi_soft.core.runtime import ti

INNER = 1e-4
"""Smallest fraction of an edge between its ends and a point that counts as inside the edge."""

PARALLEL = 0.02
"""Sine of the angle between two edges below which they count as parallel. The contact normal of parallel
edges is the direction of their separation."""

NORMAL_SLACK = 0.05
"""Cosine by which a contact normal can lie outside the normals of an edge's triangles."""

DEEPEST = 0.3
"""Largest depth at which two edges of solids touch, relative to the shorter edge. At a larger depth, edges on
opposite sides of a thin body could touch."""

UNDECIDED = 0.5
"""Distance, relative to the thickness, up to which two edges without an inside keep the side of the last
substep."""


@ti.func
def _into_face(state: ti.template(), start, along, corner):
    """Return the unit vector from an edge into one of its triangles, perpendicular to the edge."""
    inward = state.particle_position[corner] - start
    inward -= inward.dot(along) * along
    return inward / ti.max(inward.norm(), 1e-30)


@ti.func
def _is_nearest(state: ti.template(), corners, start, edge, outward):
    """1 if an edge is the nearest part of its body for points in the direction `outward` from the edge.

    The edge of a sheet or a rope is nearest in every direction.
    """
    is_nearest = 1
    if corners.z >= 0:
        along = edge / ti.max(edge.norm(), 1e-30)
        for corner in ti.static(range(2, 4)):
            inward = _into_face(state, start, along, corners[corner])
            is_nearest = is_nearest & int(outward.dot(inward) <= NORMAL_SLACK)
    return is_nearest


@ti.func
def _friction_levers(d, e, normal, distance):
    """Return the levers of the four ends with which friction between two edges has no torque.

    Friction acts at the nearest points, `distance` apart along the normal. Its torque is balanced by impulses
    along the normal: opposite ones at the two ends of each edge.
    Args: d, e: vectors along the two edges [m]. They must not be parallel.
    """
    scale = distance / normal.dot(d.cross(e))
    mine, theirs = scale * e.cross(normal), scale * d.cross(normal)
    return ti.Matrix.rows([mine, -mine, -theirs, theirs])


@ti.func
def select_edge_contact(state: ti.template(), body, slot, impact_speed, h):
    """Decide whether a candidate of two edges is a contact, and store its gap, normal and weights.

    For `impact_speed` and `h`, see `list_near_candidates`.
    """
    points = state.soft.slot_points[slot]
    mine = state.soft.edge_corners[edge_of(state, body, state.soft.slot_feature[slot])]
    theirs = state.soft.edge_corners[state.soft.slot_partner[slot]]
    p, q = state.particle_position[points[0]], state.particle_position[points[2]]
    d, e = state.particle_position[points[1]] - p, state.particle_position[points[3]] - q
    s, t = closest_points_on_segments(p, d, q, e)
    separation = p + s * d - q - t * e
    away, across, lengths = separation.norm(), d.cross(e), d.norm() * e.norm()
    is_end, is_their_end = ti.min(s, 1.0 - s) <= INNER, ti.min(t, 1.0 - t) <= INNER
    is_parallel = across.norm() <= PARALLEL * lengths
    is_crossing = not (is_parallel or is_end or is_their_end)
    can_touch = is_crossing
    if not is_crossing:  # ends of edges touch ropes only
        is_rope, is_their_rope = mine.z == OF_ROPE, theirs.z == OF_ROPE
        can_touch = (
            (is_rope or is_their_rope) and (is_their_rope or not is_end) and (is_rope or not is_their_end)
        )
    normal = separation / ti.max(away, 1e-30)
    if is_crossing:
        normal = across / ti.max(across.norm(), 1e-30)
    thickness, approach = contact_range(state, slot, True, impact_speed, h)

    # The side on which the two are: the side of the last substep, or of their separation.
    side, before = separation, state.soft.slot_normal[slot]
    if away <= UNDECIDED * thickness and before.norm_sqr() > 0.0:
        side = before
    normal *= ti.select(normal.dot(side) < 0.0, -1.0, 1.0)
    deepest = ti.cast(NO_CONTACT, ti.f32)
    if mine.z >= 0 or theirs.z >= 0:
        deepest = DEEPEST * ti.min(d.norm(), e.norm())
        is_front = _is_nearest(state, mine, p, d, -normal) & _is_nearest(state, theirs, q, e, normal)
        is_back = _is_nearest(state, mine, p, d, normal) & _is_nearest(state, theirs, q, e, -normal)
        normal *= ti.select(is_front == 0, -1.0, 1.0)
        can_touch = can_touch and (is_front | is_back) == 1
    distance = separation.dot(normal)
    state.soft.slot_normal[slot] = normal
    state.soft.slot_gap[slot] = NO_CONTACT
    is_within = distance <= thickness + approach and distance >= -deepest
    if can_touch and is_within and is_finite(separation) == 1 and is_finite(normal) == 1 and lengths > 0.0:
        weights = ti.Vector([1.0 - s, s, t - 1.0, -t])
        state.soft.slot_gap[slot] = distance - thickness
        state.soft.slot_weights[slot] = weights
        state.soft.slot_axis[slot] = normal
        # Parallel edges have no friction, because their ends cannot balance its torque.
        state.soft.slot_shares[slot] = ti.select(is_parallel, 0.0, 1.0) * weights
        state.soft.slot_levers[slot] = ti.Matrix.zero(ti.f32, 4, 3)
        if not is_parallel:
            state.soft.slot_levers[slot] = _friction_levers(d, e, normal, distance)
