"""The Taichi fields of contact: colliders, and the contacts of bodies with colliders and with each other."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.layout import BodyArrays, Ranges, Scene
from taichi_soft.core.constants import LANES
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import (
    BODY,
    COLLIDER,
    CONTACT,
    CONTACT_EDGE,
    FEATURE,
    GRID_CELL,
    LOADED,
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
"""Maximum number of triangles that a search stores for one vertex. This is enough for a vertex at which three
bodies meet."""

SLOTS = 8
"""Number of slots for candidates of a body, per vertex. Most vertices have no candidates, so that other
vertices of the body can use more slots than this."""

PAIR_ROWS = 32
"""Number of pairs of bodies whose impulses are recorded, per body of an island. This is enough for all pairs
of 65 bodies. In a larger island, it is enough for 64 partners of each body."""

MAX_PARTNERS = 32
"""Largest number of bodies from which a body is moved apart in a step. A body that overlaps more bodies than
this has no contact with other bodies."""

NO_CONTACT = 1e30
"""Gap of a candidate that is out of range."""

MAX_IMPULSE = 1e30
"""Largest valid impulse of a contact in a snapshot [N s]."""


@dataclass(frozen=True)
class ContactCapacity:
    """Capacity for contact. All values are 0 or False in a world without contact."""

    colliders: int = 0
    samples: int = 0  # number of grid samples of height fields and meshes
    soft: bool = False  # True if bodies touch each other
    hull: bool = False  # True if any body has a hull
    rigid: bool = False  # True if any body is rigid
    edges: int = 0  # number of contact edges


class ColliderFields(FieldGroup):
    """Colliders, and contacts: one row for each pair of a body and a collider.

    The row of body b and collider c is b * n + c, with the capacity n for colliders. In a fixed step, a
    collider starts at `position` and `rotation`, and moves with the constant `velocity` and `spin`.
    """

    owner, when = "contact", "has_contact"
    count = declare(WORLD, ti.i32, native=True)  # rows in use, including those of removed colliders
    kind = declare(COLLIDER, ti.i32, native=True)  # a `ShapeKind`, or NO_COLLIDER
    parameters = declare(COLLIDER, ti.f32, 8, native=True)
    resolution = declare(COLLIDER, ti.i32, 3)
    offset = declare(COLLIDER, ti.i32)  # row of the grid's first sample
    # Pose at the start of the step, and motion during the step.
    position = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    position_residue = declare(COLLIDER, ti.f32, 3, unit="m", native=True)  # rounding error of `position`
    rotation = declare(COLLIDER, ti.f32, 4, native=True)  # unit quaternion
    velocity = declare(COLLIDER, ti.f32, 3, unit="m/s", native=True)
    spin = declare(COLLIDER, ti.f32, 3, unit="rad/s", native=True)
    surface = declare(COLLIDER, ti.f32, 3, native=True)  # friction, restitution, thickness [m]
    # Velocity of the surface relative to the collider, in the collider's frame. Only friction feels it.
    surface_velocity = declare(COLLIDER, ti.f32, 3, unit="m/s", native=True)
    filter = declare(COLLIDER, ti.i32, 2, native=True)  # group, mask
    # Box around the collider's path in the step.
    lower = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    upper = declare(COLLIDER, ti.f32, 3, unit="m", native=True)
    speed = declare(COLLIDER, ti.f32, unit="m/s", native=True)  # upper bound for the fastest point
    samples = declare(SAMPLE, ti.f32)

    near = declare(CONTACT, ti.i32)  # colliders near a body, in the body's first rows
    near_count = declare(BODY, ti.i32, start=0)
    reach = declare(BODY, ti.f32, unit="m")  # distance travelled after which other colliders can be near
    gone = declare(BODY, ti.f32, unit="m")  # distance travelled since the near colliders were listed
    # Impulse on the collider in this step, and angular impulse about the collider's position. Empty slots
    # contain zeros, so that the total on a collider is the sum over all slots.
    impulse = declare(CONTACT, ti.f32, 3, unit="N s", start=0, keep=CONTACT)
    angular_impulse = declare(CONTACT, ti.f32, 3, unit="N m s", start=0, keep=CONTACT)
    normal_impulse = declare(CONTACT, ti.f32, 3, unit="N s")  # on the body, in this substep
    # Sums over the particles of the body: normal impulse [N s]; normal impulse times the speed of the surface
    # along the normal [J]; normal impulse times the speed of approach [J].
    normal_impulse_rates = declare(CONTACT, ti.f32, 3)
    # Largest speed at which the body can leave the collider, 0 without contact. `prev_rebound` is the value
    # of `rebound` before the step.
    rebound = declare(CONTACT, ti.f32, unit="m/s", start=0, keep=CONTACT)
    prev_rebound = declare(CONTACT, ti.f32, unit="m/s")
    # Distance that a particle can travel after the last search without touching a collider. An inner particle
    # that is not checked has the value `UNCHECKED`.
    particle_clearance = declare(PARTICLE, ti.f32, unit="m", start=math.inf)

    def __init__(self, capacity: Any, real: Any) -> None:
        """Allocate the fields, filled with zeros."""
        super().__init__(capacity, real)
        self.capacity: ContactCapacity = capacity.contact
        self.loader = Loader()  # for data that do not change when a collider moves


class SoftContactFields(FieldGroup):
    """Contact between bodies: candidates of vertices and edges, and contacts.

    A feature is a vertex or an edge that looks for contact. The features of a body are consecutive: first its
    vertices, then its contact edges. A vertex touches triangles, and an edge touches edges.

    A contact acts between four points: a vertex and three corners, or two ends of each edge.
    """

    owner, when = "contact", "has_soft_contact"
    body_touches_itself = declare(BODY, ti.i32, start=LOADED)
    # Ends of each contact edge, and the opposite corners of its triangles: see `bodies.contact_edges`.
    body_edges = declare(BODY, ti.i32, 2, start=LOADED)
    body_sharp_end = declare(BODY, ti.i32, start=LOADED)  # end of the sharp edges, which come first
    edge_corners = declare(CONTACT_EDGE, ti.i32, 4, start=LOADED)
    body_half_edge = declare(BODY, ti.f32, unit="m")  # half of the longest contact edge at the last search
    body_is_slim = declare(BODY, ti.i32)  # 1 if a sharp edge is slim at the last search, see `SLIM`
    # Grid of the features of a body near another body. Each body has its own part, which is filled again for
    # each other body.
    cell_first = declare(GRID_CELL, ti.i32)
    item = declare(FEATURE, ti.i32)  # features near the other body
    # `item` sorted by grid cell, and the position of the vertex, or of the middle of the edge, in each row.
    cell_item = declare(FEATURE, ti.i32)
    cell_position = declare(FEATURE, ti.f32, 3, unit="m")
    # State at the last search: corners of the triangles' boxes, and positions of the particles.
    triangle_lower = declare(TRIANGLE, ti.f32, 3, unit="m")
    triangle_upper = declare(TRIANGLE, ti.f32, 3, unit="m")
    searched_position = declare(PARTICLE, ti.f32, 3, unit="m")
    # Displacements are relative to the mean motion of the island. The results of a search are valid for
    # displacements up to `body_reach`.
    body_reach = declare(BODY, ti.f32, unit="m")
    body_lost = declare(BODY, ti.f32, unit="m")  # smallest gap to a triangle or edge without a slot
    body_gone = declare(BODY, ti.f32, unit="m")  # largest displacement of a vertex since the last search
    particle_gone = declare(PARTICLE, ti.f32, unit="m")  # displacement since the last search
    found_count = declare(FEATURE, ti.i32)
    found_partner = declare(FEATURE, ti.i32, each=FOUND)  # triangle of a vertex, contact edge of an edge
    found_distance = declare(FEATURE, ti.f32, unit="m", each=FOUND)  # distance at the last search
    # Candidates of each body, feature by feature, without gaps; vertices come first. The last `LANES` rows
    # are read, but never used.
    slot_count = declare(BODY, ti.i32, start=0)
    vertex_slot_count = declare(BODY, ti.i32, start=0)
    slot_points = declare(FEATURE, ti.i32, 4, each=SLOTS, beyond=LANES)
    slot_feature = declare(FEATURE, ti.i32, each=SLOTS)
    slot_partner = declare(FEATURE, ti.i32, each=SLOTS)
    # Distance at the last search, minus the thickness.
    slot_spare = declare(FEATURE, ti.f32, unit="m", each=SLOTS, beyond=LANES)
    # Slots of the candidates that can touch in this substep. The remaining rows of a body are outdated.
    near_slot = declare(FEATURE, ti.i32, each=SLOTS, beyond=LANES)
    slot_gap = declare(FEATURE, ti.f32, unit="m", each=SLOTS)  # distance minus thickness, or NO_CONTACT
    # Weights of the four points. The weighted sum of their velocities is the relative velocity of the nearest
    # points.
    slot_weights = declare(FEATURE, ti.f32, 4, each=SLOTS)
    slot_normal = declare(FEATURE, ti.f32, 3, each=SLOTS)  # contact normal, from the partner to the feature
    slot_normal_impulse = declare(FEATURE, ti.f32, unit="N s", each=SLOTS)  # along the normal in this substep
    slot_friction_impulse = declare(FEATURE, ti.f32, 3, unit="N s", each=SLOTS)  # friction on the feature
    # Slots of the contacts in this substep, without gaps for each body. Between a search and the narrow
    # phase, these rows list the contacts of the last substep. Slots that are not listed have no impulse.
    contact_count = declare(BODY, ti.i32, start=0)
    contact_slot = declare(FEATURE, ti.i32, each=SLOTS)
    # Terms of a contact that stay constant during the solver's sweeps: see `contact_solver`.
    slot_inv_mass = declare(FEATURE, ti.f32, 4, unit="1/kg", each=SLOTS)
    slot_moves = declare(FEATURE, ti.f32, 4, each=SLOTS)  # 1 for points of bodies that can move
    slot_axis = declare(FEATURE, ti.f32, 3, each=SLOTS)  # unit vector of the impulses by `slot_levers`
    slot_shares = declare(FEATURE, ti.f32, 4, each=SLOTS)  # fractions of the friction impulse on the points
    slot_levers = declare(FEATURE, ti.f32, (4, 3), each=SLOTS)
    # Contact with the largest normal impulse on a particle at the end of the last step. The impulse is 0 if
    # the particle had no contact.
    kept_triangle = declare(PARTICLE, ti.i32, keep=PARTICLE)
    kept_normal_impulse = declare(PARTICLE, ti.f32, unit="N s", start=0, keep=PARTICLE, most=MAX_IMPULSE)
    kept_friction_impulse = declare(PARTICLE, ti.f32, 3, unit="N s", keep=PARTICLE, most=MAX_IMPULSE)
    # The same for the contact edges.
    kept_edge = declare(CONTACT_EDGE, ti.i32, keep=CONTACT_EDGE)
    kept_edge_normal_impulse = declare(
        CONTACT_EDGE, ti.f32, unit="N s", start=0, keep=CONTACT_EDGE, most=MAX_IMPULSE
    )
    kept_edge_friction_impulse = declare(
        CONTACT_EDGE, ti.f32, 3, unit="N s", keep=CONTACT_EDGE, most=MAX_IMPULSE
    )
    records_touches = declare(WORLD, ti.i32, start=0, native=True)  # 1 if the pairs below are recorded
    # Pairs of bodies, grouped by island. The smaller index is first. A free row contains zeros.
    pair_bodies = declare(BODY, ti.i32, 2, each=PAIR_ROWS, start=0)
    # Impulse on the second body of the pair in a step.
    pair_impulse = declare(BODY, ti.f32, 3, unit="N s", each=PAIR_ROWS, start=0)
    pairs_lost = declare(WORLD, ti.i32, start=0)  # 1 if pairs were lost because no row was free
    # Bodies placed inside each other: see `kernels/parting.py`.
    partner_count = declare(BODY, ti.i32, start=0)  # number of bodies that overlap the body in this step
    partner = declare(BODY, ti.i32, each=MAX_PARTNERS)
    center = declare(BODY, ti.f32, 3, unit="m")  # centre of mass after the step
    displacement = declare(BODY, ti.f32, 3, unit="m")  # displacement of the centre in the step
    mean_velocity = declare(BODY, ti.f32, 3, unit="m/s")  # velocity of the centre
    size = declare(BODY, ti.f32, unit="m")  # largest side of the bounding box
    mobility = declare(BODY, ti.f32, unit="1/kg")  # inverse mass; 0 if pinned or not moving
    parting_shift = declare(BODY, ti.f32, 3, unit="m")  # sum of the displacements away from all partners
    parting_kick = declare(BODY, ti.f32, 3, unit="m/s")  # velocity change that stops the approach

    def load(self, loader: Loader, scene: Scene) -> None:
        """Fill the contact edges from `scene`."""
        corners = np.zeros((scene.contact_edge_count, 4), dtype=np.int32)
        used, sharp = [], []
        for body, place in zip(scene.bodies, scene.ranges, strict=True):
            (rows, count), first = touching_edges(body, place), place.contact_edges[0]
            used.append((first, first + len(rows)))
            sharp.append(first + count)
            corners[slice(*used[-1])] = np.where(rows >= 0, rows + place.particles[0], rows)
        loader.fill(self.body_edges, np.array(used))
        loader.fill(self.body_sharp_end, np.array(sharp))
        loader.fill(self.edge_corners, corners)


def touching_edges(body: BodyArrays, place: Ranges) -> tuple[NDArray[np.int32], int]:
    """Return the contact edges of a body in a world, as `find_contact_edges` does.

    Points are numbered from the first particle of the body. If cuts have made more edges than the body has
    rows, the last edges are omitted.
    """
    room = place.contact_edges[1] - place.contact_edges[0]
    count = len(body.contact_edges) if place.has_flat_edges else body.sharp_edges
    edges = body.contact_edges[: min(count, room)]
    sharp = min(body.sharp_edges, len(edges))
    if body.hull is None:
        return edges, sharp
    first = place.particles[1] - place.particles[0] - len(body.hull.vertices)
    return np.where(edges >= 0, edges + np.int32(first), edges), sharp
