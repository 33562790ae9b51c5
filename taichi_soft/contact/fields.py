"""The Taichi fields of contact: colliders, and the contacts of bodies with colliders and with each other."""

import math
from dataclasses import dataclass
from typing import Any

from taichi_soft.core.constants import LANES
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import (
    BODY,
    COLLIDER,
    CONTACT,
    GRID_CELL,
    LOADED,
    OUTER,
    PARTICLE,
    SAMPLE,
    TRIANGLE,
    WORLD,
    FieldGroup,
    declare,
)
from taichi_soft.core.runtime import ti

NO_COLLIDER = -1
"""Kind of a row whose collider was removed."""

FOUND = 16
"""Maximum number of triangles that a search keeps for one vertex: enough where three bodies meet."""

SLOTS = 8
"""Slots for candidates of a body, per vertex. Most vertices have none, so that others can use more."""

PAIR_ROWS = 32
"""Pairs of bodies whose impulses can be recorded, per body of an island. This is enough for all pairs of 65
bodies, and in a larger island for 64 partners of each body."""

MAX_PARTNERS = 32
"""Bodies from which a body is moved apart at a time. A body that overlaps more of them touches no other."""

NO_CONTACT = 1e30
"""Gap of a candidate that is out of range."""

MAX_IMPULSE = 1e30
"""Largest valid impulse of a contact in a snapshot [N s]."""


@dataclass(frozen=True)
class ContactCapacity:
    """Capacity for contact; all zero in a world without contact."""

    colliders: int = 0
    samples: int = 0  # of the grids of height fields and meshes
    soft: bool = False  # True if bodies touch each other
    hull: bool = False  # True if any body has a hull


class ColliderFields(FieldGroup):
    """Colliders, and contacts: one row for each pair of a body and a collider.

    The row of body b and collider c is b * colliders + c. In a fixed step, a collider starts at `position`
    and `rotation`, and moves with the constant `velocity` and `spin`.
    """

    owner, when = "contact", "has_contact"
    count = declare(WORLD, ti.i32, native=True)  # rows in use, including those of removed colliders
    kind = declare(COLLIDER, ti.i32, native=True)  # a `ShapeKind`, or NO_COLLIDER
    parameters = declare(COLLIDER, ti.f32, 8, native=True)
    resolution = declare(COLLIDER, ti.i32, 3)
    offset = declare(COLLIDER, ti.i32)  # row of its first sample
    # Pose at the start of the step, and motion in it.
    position = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    rotation = declare(COLLIDER, ti.f32, 4, native=True)  # unit quaternion
    velocity = declare(COLLIDER, ti.f32, 3, unit="m/s", native=True)
    spin = declare(COLLIDER, ti.f32, 3, unit="rad/s", native=True)
    surface = declare(COLLIDER, ti.f32, 3, native=True)  # friction, restitution, thickness [m]
    filter = declare(COLLIDER, ti.i32, 2, native=True)  # group, mask
    # Box around its path in the step.
    lower = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    upper = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    speed = declare(COLLIDER, ti.f32, unit="m/s", native=True)  # upper bound for its fastest point
    samples = declare(SAMPLE, ti.f32)

    near = declare(CONTACT, ti.i32)  # colliders near a body, at the front of its rows
    near_count = declare(BODY, ti.i32, start=0)
    reach = declare(BODY, ti.f32, unit="m")  # distance after which other colliders can be near
    gone = declare(BODY, ti.f32, unit="m")  # farthest distance travelled since the last search for them
    # Impulse on the collider in this step, and angular impulse about its position. Empty slots contain zeros:
    # the total on a collider is the sum over all slots.
    impulse = declare(CONTACT, ti.f32, 3, unit="N s", start=0, keep=CONTACT)
    angular_impulse = declare(CONTACT, ti.f32, 3, unit="N m s", start=0, keep=CONTACT)
    normal_impulse = declare(CONTACT, ti.f32, 3, unit="N s")  # on the body in this substep
    # Sums over the particles of the body: normal impulse [N s]; normal impulse times the speed of the surface
    # along the normal [J]; normal impulse times the speed of approach [J].
    normal_impulse_rates = declare(CONTACT, ti.f32, 3)
    # Speed at which the body can leave the collider, 0 without contact; its value before the step.
    rebound = declare(CONTACT, ti.f32, unit="m/s", start=0, keep=CONTACT)
    prev_rebound = declare(CONTACT, ti.f32, unit="m/s")
    body_filter = declare(BODY, ti.i32, 2, start=LOADED)  # group, mask
    # Distance from all near colliders at the last search. Inner particles count as far away.
    particle_clearance = declare(PARTICLE, ti.f32, unit="m", start=math.inf)

    def __init__(self, capacity: Any, real: Any) -> None:
        """Allocate; contents are zero."""
        super().__init__(capacity, real)
        self.capacity: ContactCapacity = capacity.contact
        self.loader = Loader()  # of data that do not change when a collider moves


class SoftContactFields(FieldGroup):
    """Contact between bodies: a grid of vertices, and candidates.

    Each body has its own part of the grid, which it fills again for each other body.
    """

    owner, when = "contact", "has_soft_contact"
    body_touches_itself = declare(BODY, ti.i32, start=LOADED)
    cell_first = declare(GRID_CELL, ti.i32)
    item = declare(OUTER, ti.i32)  # rows of `outer_particle` near the other body
    # The same rows in the order of their cells, and the positions of their particles.
    cell_item = declare(OUTER, ti.i32)
    cell_position = declare(OUTER, ti.f32, 3, unit="m")
    # State at the last search: corners of the boxes of triangles, and positions.
    triangle_lower = declare(TRIANGLE, ti.f32, 3, unit="m")
    triangle_upper = declare(TRIANGLE, ti.f32, 3, unit="m")
    searched_position = declare(PARTICLE, ti.f32, 3, unit="m")
    # Relative to the mean motion of the island: the distance up to which the results of a search are valid,
    # and the distances that each body and each vertex are from their positions at that search.
    body_reach = declare(BODY, ti.f32, unit="m")
    body_lost = declare(BODY, ti.f32, unit="m")  # the same, limited by triangles without a slot
    body_gone = declare(BODY, ti.f32, unit="m")
    particle_gone = declare(PARTICLE, ti.f32, unit="m")
    found_count = declare(OUTER, ti.i32)
    found_triangle = declare(OUTER, ti.i32, each=FOUND)
    found_distance = declare(OUTER, ti.f32, unit="m", each=FOUND)  # at the last search
    # Candidates of each body, vertex by vertex, without gaps. The last `LANES` rows are read, but never used.
    slot_count = declare(BODY, ti.i32, start=0)
    # Vertex and corners of the triangle.
    slot_vertices = declare(OUTER, ti.i32, 4, each=SLOTS, beyond=LANES)
    slot_triangle = declare(OUTER, ti.i32, each=SLOTS)
    # Distance at the last search, minus the thickness.
    slot_spare = declare(OUTER, ti.f32, unit="m", each=SLOTS, beyond=LANES)
    # Slots of the candidates that are near now. The rows after them are outdated.
    near_slot = declare(OUTER, ti.i32, each=SLOTS, beyond=LANES)
    slot_gap = declare(OUTER, ti.f32, unit="m", each=SLOTS)  # distance minus thickness; or NO_CONTACT
    slot_weights = declare(OUTER, ti.f32, 3, each=SLOTS)  # barycentric, of the nearest point
    slot_normal = declare(OUTER, ti.f32, 3, each=SLOTS)  # from the triangle to the vertex
    slot_normal_impulse = declare(OUTER, ti.f32, unit="N s", each=SLOTS)  # along the normal in this substep
    slot_friction_impulse = declare(OUTER, ti.f32, 3, unit="N s", each=SLOTS)  # on the vertex
    # Slots of the contacts of this substep, without gaps for each body. Between a search and the narrow
    # phase, they are the contacts of the last substep. All other slots have no impulse.
    contact_count = declare(BODY, ti.i32, start=0)
    contact_slot = declare(OUTER, ti.i32, each=SLOTS)
    # Terms of a contact that stay constant during the solver's sweeps: inverse masses of the vertex and the
    # corners; 1 if the body of the vertex, or of the triangle, can move; normal of the triangle; fractions of
    # the impulse that the corners get; height above the triangle times the gradients of the weights.
    slot_inv_mass = declare(OUTER, ti.f32, 4, unit="1/kg", each=SLOTS)
    slot_moves = declare(OUTER, ti.f32, 2, each=SLOTS)
    slot_face = declare(OUTER, ti.f32, 3, each=SLOTS)
    slot_shares = declare(OUTER, ti.f32, 3, each=SLOTS)
    slot_levers = declare(OUTER, ti.f32, (3, 3), each=SLOTS)
    # Contact with the largest normal impulse on a particle at the end of the last step. The impulse is 0 if
    # there was none.
    kept_triangle = declare(PARTICLE, ti.i32, keep=PARTICLE)
    kept_normal_impulse = declare(PARTICLE, ti.f32, unit="N s", start=0, keep=PARTICLE, most=MAX_IMPULSE)
    kept_friction_impulse = declare(PARTICLE, ti.f32, 3, unit="N s", keep=PARTICLE, most=MAX_IMPULSE)
    records_touches = declare(WORLD, ti.i32, start=0, native=True)  # 1 if the rows below are filled
    # Pairs of bodies, the smaller index first; zeros in a free row. Grouped by island.
    pair_bodies = declare(BODY, ti.i32, 2, each=PAIR_ROWS, start=0)
    # Impulse on the second body in a step.
    pair_impulse = declare(BODY, ti.f32, 3, unit="N s", each=PAIR_ROWS, start=0)
    pairs_lost = declare(WORLD, ti.i32, start=0)  # 1 if pairs were lost because no row was free
    # Bodies placed inside each other: see `kernels/parting.py`.
    partner_count = declare(BODY, ti.i32, start=0)  # bodies that it overlaps in this step
    partner = declare(BODY, ti.i32, each=MAX_PARTNERS)
    center = declare(BODY, ti.f32, 3, unit="m")  # of mass, after the step
    displacement = declare(BODY, ti.f32, 3, unit="m")  # of the centre in the step
    mean_velocity = declare(BODY, ti.f32, 3, unit="m/s")  # of the centre
    size = declare(BODY, ti.f32, unit="m")  # largest side
    mobility = declare(BODY, ti.f32, unit="1/kg")  # inverse mass; 0 if pinned or not moving
    parting_shift = declare(BODY, ti.f32, 3, unit="m")  # sum of the displacements away from all partners
    parting_kick = declare(BODY, ti.f32, 3, unit="m/s")  # change of velocity
