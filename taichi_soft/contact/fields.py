"""The Taichi fields of contact: colliders, and what each body has to do with them in the present step."""

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
"""Kind of a row of which the collider was removed."""

FOUND = 16
"""Triangles that a search may find for one vertex: where three bodies meet, and their triangles beside."""

SLOTS = 8
"""Room for what is found for the vertices of a body, for each of them. Most have nothing near."""

PAIR_ROWS = 32
"""Pairs of bodies whose impulses can be recorded, per body of an island: room for all pairs of 65 bodies, and
for each of more to touch 64 others."""

MAX_PARTNERS = 32
"""Bodies from which one is parted at a time. One that overlaps more touches no other body meanwhile."""

NO_CONTACT = 1e30
"""Gap of a candidate that is out of reach."""

MAX_IMPULSE = 1e30
"""Largest impulse of a contact that a snapshot may have [N s]."""


@dataclass(frozen=True)
class ContactCapacity:
    """Room for contact; all zero in a world without."""

    colliders: int = 0
    samples: int = 0  # of the grids of height fields and meshes
    soft: bool = False  # whether bodies touch each other
    hull: bool = False  # whether any of them does so by a hull


class ColliderFields(FieldGroup):
    """Colliders as rows of fields, and for each pair of a body and a collider a row of what passes between.

    The row of body b and collider c is b * colliders + c. A collider moves through a fixed step with the
    velocity and the spin it has here, from the pose it has here.
    """

    owner, when = "contact", "has_contact"
    count = declare(WORLD, ti.i32, native=True)  # rows in use, removed ones among them
    kind = declare(COLLIDER, ti.i32, native=True)  # a `ShapeKind`, or NO_COLLIDER
    parameters = declare(COLLIDER, ti.f32, 8, native=True)
    resolution = declare(COLLIDER, ti.i32, 3)
    offset = declare(COLLIDER, ti.i32)  # of its first sample
    # At the start of the step.
    position = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    rotation = declare(COLLIDER, ti.f32, 4, native=True)  # unit quaternion
    velocity = declare(COLLIDER, ti.f32, 3, unit="m/s", native=True)
    spin = declare(COLLIDER, ti.f32, 3, unit="rad/s", native=True)
    surface = declare(COLLIDER, ti.f32, 3, native=True)  # friction, restitution, thickness [m]
    filter = declare(COLLIDER, ti.i32, 2, native=True)  # group, mask
    # Box around its path in the step.
    lower = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    upper = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    speed = declare(COLLIDER, ti.f32, unit="m/s", native=True)  # of its fastest point, at most
    samples = declare(SAMPLE, ti.f32)

    near = declare(CONTACT, ti.i32)  # colliders within reach of a body, packed to the front
    near_count = declare(BODY, ti.i32, start=0)
    reach = declare(BODY, ti.f32, unit="m")  # distance after which other colliders may be near
    gone = declare(BODY, ti.f32, unit="m")  # longest distance moved since the near ones were searched
    # On the collider in this step, and about its position. Slots that stay empty have them too: the impulse
    # of a collider is a sum over all.
    impulse = declare(CONTACT, ti.f32, 3, unit="N s", start=0, keep=CONTACT)
    angular_impulse = declare(CONTACT, ti.f32, 3, unit="N m s", start=0, keep=CONTACT)
    normal_impulse = declare(CONTACT, ti.f32, 3, unit="N s")  # on the body in this substep
    # Of the normal impulses of its particles: their sum [N s], and those times the speed along the normal
    # with which the surface came, and with which particle and surface came together [N].
    normal_impulse_rates = declare(CONTACT, ti.f32, 3)
    # Speed at which the body may leave, 0 if apart; and before the step.
    rebound = declare(CONTACT, ti.f32, unit="m/s", start=0, keep=CONTACT)
    prev_rebound = declare(CONTACT, ti.f32, unit="m/s")
    body_filter = declare(BODY, ti.i32, 2, start=LOADED)  # group, mask
    # From all that is near, when that was searched. Inside a body nothing is near.
    particle_clearance = declare(PARTICLE, ti.f32, unit="m", start=math.inf)

    def __init__(self, capacity: Any, real: Any) -> None:
        """Allocate; contents are zero."""
        super().__init__(capacity, real)
        self.capacity: ContactCapacity = capacity.contact
        self.loader = Loader()  # of what does not change when a collider moves


class SoftContactFields(FieldGroup):
    """What bodies need to touch each other: a grid of vertices, and candidates.

    Each body has a part of them, which it uses for one other body after the next.
    """

    owner, when = "contact", "has_soft_contact"
    body_touches_itself = declare(BODY, ti.i32, start=LOADED)
    cell_first = declare(GRID_CELL, ti.i32)
    item = declare(OUTER, ti.i32)  # rows of `outer_particle` that may be near the other body
    # The same, cell by cell, and their positions.
    cell_item = declare(OUTER, ti.i32)
    cell_position = declare(OUTER, ti.f32, 3, unit="m")
    # At the search: corners of boxes, and positions.
    triangle_lower = declare(TRIANGLE, ti.f32, 3, unit="m")
    triangle_upper = declare(TRIANGLE, ti.f32, 3, unit="m")
    searched_position = declare(PARTICLE, ti.f32, 3, unit="m")
    # Relative to what the bodies of an island share: distances for which a search holds, and how far each
    # body and each vertex is from where it was then.
    body_reach = declare(BODY, ti.f32, unit="m")
    body_lost = declare(BODY, ti.f32, unit="m")  # distance for which the vertices of a pair had room enough
    body_gone = declare(BODY, ti.f32, unit="m")
    particle_gone = declare(PARTICLE, ti.f32, unit="m")
    found_count = declare(OUTER, ti.i32)
    found_triangle = declare(OUTER, ti.i32, each=FOUND)
    found_distance = declare(OUTER, ti.f32, unit="m", each=FOUND)  # at the search
    # Candidates, of each body vertex by vertex, without gaps. Code reads the last `LANES` rows and never
    # uses them.
    slot_count = declare(BODY, ti.i32, start=0)
    # The vertex, and the triangle's corners.
    slot_vertices = declare(OUTER, ti.i32, 4, each=SLOTS, beyond=LANES)
    slot_triangle = declare(OUTER, ti.i32, each=SLOTS)
    # Distance at the search beyond the thickness.
    slot_spare = declare(OUTER, ti.f32, unit="m", each=SLOTS, beyond=LANES)
    near_slot = declare(OUTER, ti.i32, each=SLOTS, beyond=LANES)  # near now; behind them, old ones
    slot_gap = declare(OUTER, ti.f32, unit="m", each=SLOTS)  # beyond the thickness; or NO_CONTACT
    slot_weights = declare(OUTER, ti.f32, 3, each=SLOTS)  # barycentric, of the nearest point
    slot_normal = declare(OUTER, ti.f32, 3, each=SLOTS)  # from the triangle to the vertex
    slot_normal_impulse = declare(OUTER, ti.f32, unit="N s", each=SLOTS)  # along it in this substep
    slot_friction_impulse = declare(OUTER, ti.f32, 3, unit="N s", each=SLOTS)  # on the vertex
    # Contacts of this substep; between a search and the gaps, those of the last one. Slots of each body
    # from its first slot on; no other slot has an impulse.
    contact_count = declare(BODY, ti.i32, start=0)
    contact_slot = declare(OUTER, ti.i32, each=SLOTS)
    # What the solves of a contact share: inverse masses of the vertex and the corners; whether the bodies of
    # the two move (1); normal of the triangle; shares of the corners in the impulse on the vertex, and height
    # over the triangle times the gradients of the weights.
    slot_inv_mass = declare(OUTER, ti.f32, 4, unit="1/kg", each=SLOTS)
    slot_moves = declare(OUTER, ti.f32, 2, each=SLOTS)
    slot_face = declare(OUTER, ti.f32, 3, each=SLOTS)
    slot_shares = declare(OUTER, ti.f32, 3, each=SLOTS)
    slot_levers = declare(OUTER, ti.f32, (3, 3), each=SLOTS)
    # The contact with the largest normal impulse on a particle at the end of the last step; 0 for none.
    kept_triangle = declare(PARTICLE, ti.i32, keep=PARTICLE)
    kept_normal_impulse = declare(PARTICLE, ti.f32, unit="N s", start=0, keep=PARTICLE, most=MAX_IMPULSE)
    kept_friction_impulse = declare(PARTICLE, ti.f32, 3, unit="N s", keep=PARTICLE, most=MAX_IMPULSE)
    records_touches = declare(WORLD, ti.i32, start=0, native=True)  # 1 if the rows below are filled
    # Two bodies, the smaller index first; both 0 in a free row. Island by island, as in `island_body`.
    pair_bodies = declare(BODY, ti.i32, 2, each=PAIR_ROWS, start=0)
    pair_impulse = declare(BODY, ti.f32, 3, unit="N s", each=PAIR_ROWS, start=0)  # on the second in a step
    pairs_lost = declare(WORLD, ti.i32, start=0)  # 1 if some had no row
    # Bodies placed inside each other: see `kernels/parting.py`.
    partner_count = declare(BODY, ti.i32, start=0)  # bodies that each overlaps in this step
    partner = declare(BODY, ti.i32, each=MAX_PARTNERS)
    center = declare(BODY, ti.f32, 3, unit="m")  # of mass, after the step
    displacement = declare(BODY, ti.f32, 3, unit="m")  # of the centre in the step
    mean_velocity = declare(BODY, ti.f32, 3, unit="m/s")  # of the centre
    size = declare(BODY, ti.f32, unit="m")  # largest side
    mobility = declare(BODY, ti.f32, unit="1/kg")  # inverse mass; 0 if pinned or not moving
    parting_shift = declare(BODY, ti.f32, 3, unit="m")  # displacement that all partners ask for
    parting_kick = declare(BODY, ti.f32, 3, unit="m/s")  # change of velocity
