"""The Taichi fields of contact: colliders, and what each body has to do with them in the present step."""

from dataclasses import dataclass
from typing import Any

from taichi_soft.core.constants import LANES
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.runtime import holds_fields, ti

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


@dataclass(frozen=True)
class ContactCapacity:
    """Room for contact; all zero in a world without."""

    colliders: int = 0
    samples: int = 0  # of the grids of height fields and meshes
    soft: bool = False  # whether bodies touch each other
    hull: bool = False  # whether any of them does so by a hull


@holds_fields
class ContactFields:
    """Colliders as rows of fields, and for each pair of a body and a collider a row of what passes between.

    The row of body b and collider c is b * colliders + c. A collider moves through a fixed step with the
    velocity and the spin it has here, from the pose it has here.
    """

    def __init__(self, capacity: ContactCapacity, particles: int, bodies: int) -> None:
        """Allocate; contents are zero."""
        c = capacity.colliders
        self.capacity = capacity
        self.loader = Loader()  # of what does not change when a collider moves
        self.collider_count = ti.field(ti.i32, ())  # rows in use, removed ones among them
        self.collider_kind = ti.field(ti.i32, c)  # a `ShapeKind`, or NO_COLLIDER
        self.collider_parameters = ti.Vector.field(8, ti.f32, c)
        self.collider_resolution = ti.Vector.field(3, ti.i32, c)
        self.collider_offset = ti.field(ti.i32, c)  # of its first sample
        self.collider_position = ti.Vector.field(3, ti.f32, c)  # [m], at the start of the step
        self.collider_rotation = ti.Vector.field(4, ti.f32, c)  # unit quaternion, at the start of the step
        self.collider_velocity = ti.Vector.field(3, ti.f32, c)  # [m/s]
        self.collider_spin = ti.Vector.field(3, ti.f32, c)  # [rad/s]
        self.collider_surface = ti.Vector.field(3, ti.f32, c)  # friction, restitution, thickness [m]
        self.collider_filter = ti.Vector.field(2, ti.i32, c)  # group, mask
        self.collider_lower = ti.Vector.field(3, ti.f32, c)  # box round its way through the step [m]
        self.collider_upper = ti.Vector.field(3, ti.f32, c)
        self.collider_speed = ti.field(ti.f32, c)  # of its fastest point [m/s], at most
        self.samples = ti.field(ti.f32, max(capacity.samples, 1))

        self.near = ti.field(ti.i32, bodies * c)  # colliders within reach of a body, packed to the front
        self.near_count = ti.field(ti.i32, bodies)
        self.reach = ti.field(ti.f32, bodies)  # way [m] after which other colliders may be near
        self.gone = ti.field(ti.f32, bodies)  # way [m] since it was looked which are near, at most
        self.impulse = ti.Vector.field(3, ti.f32, bodies * c)  # on the collider in this step [N s]
        self.angular_impulse = ti.Vector.field(3, ti.f32, bodies * c)  # about its position [N m s]
        self.normal_impulse = ti.Vector.field(3, ti.f32, bodies * c)  # on the body in this substep [N s]
        # Of the normal impulses of its particles: their sum [N s], and those times the speed along the normal
        # with which the surface came, and with which particle and surface came together [N].
        self.normal_impulse_rates = ti.Vector.field(3, ti.f32, bodies * c)
        self.rebound = ti.field(ti.f32, bodies * c)  # speed at which the body may leave [m/s]; 0 where apart
        self.prev_rebound = ti.field(ti.f32, bodies * c)  # before the step
        # Corners of a box [m]: of the way through a step, of the search in an island, or where a body sleeps.
        self.body_lower = ti.Vector.field(3, ti.f32, bodies)
        self.body_upper = ti.Vector.field(3, ti.f32, bodies)
        self.sleep_speed = ti.field(ti.f32, ())  # [m/s] below which bodies fall asleep; 0 for never
        self.calm = ti.field(ti.f32, bodies)  # time since a body was faster [s]
        self.rest_state = ti.field(ti.i32, bodies)  # MOVING, SLOW or RESTING of `vibration`
        self.is_exploding = ti.field(ti.i32, bodies)  # 1 where it must not take others with it
        self.body_filter = ti.Vector.field(2, ti.i32, bodies)  # group, mask
        self.is_stable = ti.field(ti.i32, bodies)  # 0 where forces changed a velocity by too much
        self.has_failed = ti.field(ti.i32, bodies)  # 1 where it broke or was not solved well in this step
        self.body_speed = ti.field(ti.f32, bodies)  # of its fastest particle in this substep [m/s]
        # Beside the velocity that its island shares [m/s]; by leapfrog of what was touched before the push.
        self.body_speed_beside = ti.field(ti.f32, bodies)  # of its fastest particle
        self.body_mean_beside = ti.field(ti.f32, bodies)  # root mean square over particles
        self.particle_clearance = ti.field(ti.f32, particles)  # [m] from all that is near, at that time
        self.particle_touches = ti.field(ti.i32, particles)  # 1 where something held it in the last substep

        self.island_count = ti.field(ti.i32, ())
        self.island_first = ti.field(ti.i32, bodies + 1)  # row of its first body
        self.island_body = ti.field(ti.i32, bodies)  # bodies that may touch or are joined, island by island
        self.body_island = ti.field(ti.i32, bodies)
        self.parent = ti.field(ti.i32, bodies)  # in the forest of islands

    def carried(self) -> list[list[Any]]:
        """What the next step depends on: of each particle, each body, each body and collider."""
        return [
            [self.particle_touches],
            [self.calm, self.body_lower, self.body_upper, self.body_island],  # the box in which it sleeps
            [self.impulse, self.angular_impulse, self.rebound],
        ]


@holds_fields
class SoftContactFields:
    """What bodies need to touch each other: a grid of vertices, and candidates.

    Each body has a piece of it, in which it looks at one other body after the next.
    """

    def __init__(self, particles: int, bodies: int, outer: int, triangles: int) -> None:
        """Allocate; contents are zero."""
        self.body_surface = ti.Vector.field(3, ti.f32, bodies)  # friction, thickness [m], mean edge [m]
        self.body_touches_itself = ti.field(ti.i32, bodies)
        self.sweep_order = ti.field(ti.i32, bodies)  # bodies by their lower x
        self.cell_first = ti.field(ti.i32, 4 * outer + bodies)
        self.item = ti.field(ti.i32, outer)  # rows of `outer_particle` that may be near the other body
        self.cell_item = ti.field(ti.i32, outer)  # the same, cell by cell
        self.cell_position = ti.Vector.field(3, ti.f32, outer)  # of these [m]
        self.triangle_lower = ti.Vector.field(3, ti.f32, triangles)  # corners of a box [m], at the search
        self.triangle_upper = ti.Vector.field(3, ti.f32, triangles)
        self.searched_position = ti.Vector.field(3, ti.f32, particles)  # [m], at the search
        # Beside what the bodies of an island share: ways [m] for which a search holds, and how far each body
        # and each vertex is from where it was then; speeds before contact [m/s].
        self.body_reach = ti.field(ti.f32, bodies)
        self.body_lost = ti.field(ti.f32, bodies)  # way of a pair for which its vertices had room enough
        self.body_gone = ti.field(ti.f32, bodies)
        self.particle_gone = ti.field(ti.f32, particles)
        self.particle_speed = ti.field(ti.f32, particles)
        self.found_count = ti.field(ti.i32, outer)
        self.found_triangle = ti.field(ti.i32, outer * FOUND)
        self.found_distance = ti.field(ti.f32, outer * FOUND)  # [m], at the search
        # Candidates: of each body vertex by vertex, without gaps.
        self.slot_count = ti.field(ti.i32, bodies)
        slots = outer * SLOTS + LANES  # the last ones are read and never used
        self.slot_vertices = ti.Vector.field(4, ti.i32, slots)  # the vertex, and the triangle's corners
        self.slot_triangle = ti.field(ti.i32, outer * SLOTS)
        self.slot_spare = ti.field(ti.f32, slots)  # distance at the search beyond the thickness [m]
        self.near_slot = ti.field(ti.i32, slots)  # those near in this substep; behind them, old ones
        self.slot_gap = ti.field(ti.f32, outer * SLOTS)  # [m], beyond the thickness; or NO_CONTACT
        self.slot_weights = ti.Vector.field(3, ti.f32, outer * SLOTS)  # barycentric, of the nearest point
        self.slot_normal = ti.Vector.field(3, ti.f32, outer * SLOTS)  # from the triangle to the vertex
        self.slot_normal_impulse = ti.field(ti.f32, outer * SLOTS)  # impulse along it in this substep [N s]
        self.slot_friction_impulse = ti.Vector.field(3, ti.f32, outer * SLOTS)  # friction on the vertex [N s]
        # Contacts of this substep; between a search and the gaps, those of the last one. Slots of each body
        # from its first slot on; no other slot has an impulse. Of each what its solves share: inverse masses
        # of the vertex and the corners [1/kg]; whether the bodies of the two move (1); normal of the
        # triangle; shares of the corners in what the vertex feels, and height over the triangle times the
        # gradients of the weights.
        self.contact_count = ti.field(ti.i32, bodies)
        self.contact_slot = ti.field(ti.i32, outer * SLOTS)
        self.slot_inv_mass = ti.Vector.field(4, ti.f32, outer * SLOTS)
        self.slot_moves = ti.Vector.field(2, ti.f32, outer * SLOTS)
        self.slot_face = ti.Vector.field(3, ti.f32, outer * SLOTS)
        self.slot_shares = ti.Vector.field(3, ti.f32, outer * SLOTS)
        self.slot_levers = ti.Matrix.field(3, 3, ti.f32, outer * SLOTS)
        # The contact in which a particle was pressed most at the end of the last step.
        self.kept_triangle = ti.field(ti.i32, particles)
        self.kept_normal_impulse = ti.field(ti.f32, particles)  # as `slot_normal_impulse`; 0 for none
        self.kept_friction_impulse = ti.Vector.field(3, ti.f32, particles)
        self.records_touches = ti.field(ti.i32, ())  # 1 where the rows below are filled
        # Two bodies, the smaller index first; both 0 in a free row. Island by island, as in `island_body`.
        self.pair_bodies = ti.Vector.field(2, ti.i32, bodies * PAIR_ROWS)
        self.pair_impulse = ti.Vector.field(3, ti.f32, bodies * PAIR_ROWS)  # on the second in a step [N s]
        self.pairs_lost = ti.field(ti.i32, ())  # 1 where some had no row
        # Bodies placed inside each other: see `kernels/parting.py`.
        self.overlap = ti.field(ti.i32, bodies)  # CLEAR, JUST_PLACED or OVERLAPPING
        self.partner_count = ti.field(ti.i32, bodies)  # bodies that each overlaps in this step
        self.partner = ti.field(ti.i32, bodies * MAX_PARTNERS)
        self.center = ti.Vector.field(3, ti.f32, bodies)  # of mass, after the step [m]
        self.displacement = ti.Vector.field(3, ti.f32, bodies)  # of the centre in the step [m]
        self.mean_velocity = ti.Vector.field(3, ti.f32, bodies)  # of the centre [m/s]
        self.size = ti.field(ti.f32, bodies)  # largest side [m]
        self.mobility = ti.field(ti.f32, bodies)  # inverse mass; 0 where pinned or not moving [1/kg]
        self.parting_shift = ti.Vector.field(3, ti.f32, bodies)  # displacement that all partners ask for [m]
        self.parting_kick = ti.Vector.field(3, ti.f32, bodies)  # change of velocity [m/s]

    def carried(self) -> list[list[Any]]:
        """Return the fields that the next step depends on: those of particles, and those of bodies."""
        return [[self.kept_triangle, self.kept_normal_impulse, self.kept_friction_impulse], [self.overlap]]
