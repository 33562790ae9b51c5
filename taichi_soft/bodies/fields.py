"""Taichi fields of the particles, edges and tetrahedra of bodies.

Fields exist as long as the process, because Taichi compiles kernels for each set of fields, and because
destroying a field stalls a running game. A closed world therefore returns its fields. The next world that
fits into these fields reuses them, with their compiled kernels.
"""

import gc
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.capacity import BodyCapacity
from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.layout import BodyArrays, Ranges, Scene, ShellArrays, blocks_of
from taichi_soft.bodies.status import ABSENT, CLEAR, FROZEN_DISABLED, WITH_FRAME
from taichi_soft.core.constants import LANES, POSITION_LIMIT
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import (
    BLOCK,
    BODY,
    COLLIDER,
    EDGE,
    FINITE,
    FRAME,
    LOADED,
    OUTER,
    PARTICLE,
    REAL,
    RING,
    SHAPE,
    SHELL,
    TRIANGLE,
    WORLD,
    Below,
    FieldGroup,
    declare,
)
from taichi_soft.core.runtime import make_fields, ti
from taichi_soft.core.threads import in_turn
from taichi_soft.elements.laws.shell import POINTS


class BodyFields(FieldGroup):
    """Particles, edges, tetrahedra and bodies: one field for each quantity.

    Tetrahedra lie in blocks of `LANES`, quantity by quantity: entry k of lane l in block b of a quantity
    with K entries is at (b K + k) LANES + l. The arrays are flat, because in fields of several dimensions
    Taichi 1.7 confuses stores at a constant index with loads at a computed index.
    """

    particle_position = declare(
        PARTICLE, REAL, 3, unit="m", start=LOADED, keep=PARTICLE, most=POSITION_LIMIT, native=True
    )
    # Exact position relative to `body_origin`, if the origin is not zero: see `kernels.origins`.
    particle_local = declare(PARTICLE, REAL, 3, unit="m", start=0, keep=PARTICLE, most=FINITE, native=True)
    particle_velocity = declare(  # at a time half of `body_velocity_lag` before the position
        PARTICLE, REAL, 3, unit="m/s", start=0, keep=PARTICLE, most=FINITE, native=True
    )
    # Force in a substep, zero between steps. The fourth component is always 0. It is stored because the CPU
    # loads and stores four floats at once.
    particle_force = declare(PARTICLE, REAL, 4, unit="N", start=0)
    particle_mass = declare(PARTICLE, REAL, unit="kg", start=LOADED, keep=PARTICLE, most=FINITE, native=True)
    particle_inv_mass = declare(  # 0 if pinned
        PARTICLE, REAL, unit="1/kg", start=LOADED, keep=PARTICLE, most=FINITE, native=True
    )
    particle_body = declare(PARTICLE, ti.i32, start=LOADED)
    particle_of_vertex = declare(PARTICLE, ti.i32, start=LOADED)  # particle of each vertex of the caller
    # State before the last fixed step.
    prev_position = declare(PARTICLE, REAL, 3, unit="m", start=LOADED, keep=PARTICLE, most=FINITE)
    prev_local = declare(PARTICLE, REAL, 3, unit="m", start=0)  # exact position, as `particle_local`
    prev_velocity = declare(PARTICLE, REAL, 3, unit="m/s", start=0, keep=PARTICLE, most=FINITE)
    rest_position = declare(PARTICLE, REAL, 3, unit="m", start=LOADED)
    # `particle_aim` encodes how a pinned particle moves, see `control.kernels.pins`. `particle_target` is the
    # particle's target, relative to the origin of its body, or in the axes of a frame.
    particle_aim = declare(
        PARTICLE, ti.i32, start=0, keep=PARTICLE, below=Below(FRAME, WITH_FRAME), native=True
    )
    particle_target = declare(PARTICLE, REAL, 3, unit="m", keep=PARTICLE, most=FINITE, native=True)
    # External force. It acts in the next step if `body_drives` has the bit `PUSHED`.
    particle_push = declare(PARTICLE, REAL, 3, unit="N", keep=PARTICLE, most=FINITE)
    # `particle_reaction` is the impulse of a pinned particle on its pin in the last step. `prev_reaction` is
    # the value before the step, for retries.
    particle_reaction = declare(PARTICLE, REAL, 3, unit="N s", keep=PARTICLE, native=True)
    prev_reaction = declare(PARTICLE, REAL, 3, unit="N s")

    # 1 if the particle was in contact in the last substep.
    particle_touches = declare(PARTICLE, ti.i32, start=0, keep=PARTICLE)
    # Speed before contact, relative to the mean velocity of the island.
    particle_speed = declare(PARTICLE, REAL, unit="m/s")

    tet_vertices = declare(BLOCK, ti.i32, each=4 * LANES, start=LOADED)
    tet_rest_inverse = declare(  # stored by columns; changes only if the body is plastic
        BLOCK, REAL, unit="1/m", each=9 * LANES, start=LOADED, keep=SHAPE, most=FINITE
    )
    tet_original_inverse = declare(  # `tet_rest_inverse` before plastic flow
        BLOCK, REAL, unit="1/m", each=9 * LANES, start=LOADED, when="plastic"
    )
    body_plasticity = declare(BODY, REAL, 4, start=LOADED, when="plastic")  # see `Plasticity.row`
    tet_lame = declare(BLOCK, REAL, unit="Pa", each=2 * LANES, start=LOADED)
    tet_stiffness = declare(  # upper triangle, stored by rows
        BLOCK, REAL, unit="Pa", each=21 * LANES, start=LOADED, when="anisotropic"
    )
    # Damping constant for the velocities of the corners relative to their mean.
    tet_damping = declare(BLOCK, REAL, unit="N s/m", each=LANES, start=LOADED)

    edge_vertices = declare(EDGE, ti.i32, 2, start=LOADED, layout=ti.Layout.SOA)
    edge_blocks = declare(EDGE, ti.i32, 2, start=LOADED)  # first row and number of edges of each block
    edge_damping = declare(EDGE, REAL, unit="N s/m", start=LOADED)
    edge_bond = declare(  # constants of the edge's bond, see `Bonds`
        EDGE, REAL, 4, start=LOADED, when="rings", layout=ti.Layout.SOA
    )
    edge_ring = declare(EDGE, ti.i32, 2, start=LOADED, when="rings")  # range of rows in the ring fields
    ring_members = declare(  # particles or, for laws with expansion, tetrahedra
        RING, ti.i32, 4, start=LOADED, when="rings"
    )
    ring_weights = declare(RING, REAL, 4, start=LOADED, when="rings")
    tet_inverse_volume6 = declare(  # 1 / (6 V0)
        BLOCK, REAL, unit="1/m^3", each=LANES, start=LOADED, when="rings"
    )
    tet_expansion_modulus = declare(  # E nu
        BLOCK, REAL, unit="Pa", each=LANES, start=LOADED, when="rings"
    )
    tet_pressure = declare(BLOCK, REAL, unit="Pa", each=LANES, when="rings")  # E nu dV / V0
    edge_pressure = declare(EDGE, REAL, unit="Pa", start=0, when="rings")  # sum over the adjacent tetrahedra
    tet_edges = declare(BLOCK, ti.i32, each=6 * LANES, start=LOADED, when="names_edges")

    # Shell elements lie in blocks of `LANES`, like tetrahedra. `Shells` describes their constants.
    shell_points = declare(SHELL, ti.i32, each=6 * LANES, start=LOADED, when="shells")
    shell_rest_inverse = declare(SHELL, REAL, unit="1/m", each=3 * LANES, start=LOADED, when="shells")
    shell_lame = declare(SHELL, REAL, unit="J", each=2 * LANES, start=LOADED, when="shells")
    shell_bending = declare(SHELL, REAL, each=18 * LANES, start=LOADED, when="shells")
    shell_bending_damping = declare(SHELL, REAL, unit="s", each=LANES, start=LOADED, when="shells")

    # Rods. Rows of edges and joints are those of particles, see `Rods` and `elements.kernels.rods`.
    rod_edge = declare(PARTICLE, REAL, 4, start=LOADED, when="rods")
    rod_joint = declare(PARTICLE, REAL, 4, start=LOADED, when="rods")
    rod_rest = declare(PARTICLE, REAL, 4, start=LOADED, when="rods")
    rod_frame = declare(PARTICLE, REAL, 4, start=0, keep=PARTICLE, most=FINITE, when="rods")  # quaternion
    rod_spin = declare(PARTICLE, REAL, unit="rad/s", start=0, keep=PARTICLE, most=FINITE, when="rods")
    # Angular impulse of an edge's torsion in the last step on the frame to which both its ends are attached.
    rod_reaction = declare(PARTICLE, REAL, 3, unit="N m s", start=0, keep=PARTICLE, native=True, when="rods")
    prev_rod_reaction = declare(PARTICLE, REAL, 3, unit="N m s", when="rods")
    prev_rod_frame = declare(PARTICLE, REAL, 4, when="rods")
    prev_rod_spin = declare(PARTICLE, REAL, unit="rad/s", when="rods")
    rod_rate = declare(PARTICLE, REAL, 3, unit="rad/s", when="rods")  # angular velocity of an edge
    rod_moment = declare(PARTICLE, REAL, 3, unit="N m", when="rods")  # moment of a joint on the edge after it
    rod_torque = declare(PARTICLE, REAL, unit="N m", when="rods")  # moment that changes the spin of an edge
    body_rod = declare(BODY, ti.i32, start=LOADED, when="rods")  # OPEN or CLOSED; 0 for other bodies

    # Fields for implicit integration. The linear system has 3 x 3 blocks. Diagonal blocks are stored by
    # particle. Off-diagonal blocks are stored by edge: the row of a block belongs to the first end of the
    # edge, and the column to the second end.
    particle_block = declare(PARTICLE, REAL, (3, 3), when="implicit")
    particle_block_inverse = declare(PARTICLE, REAL, (3, 3), when="implicit")
    particle_inertia = declare(PARTICLE, REAL, unit="kg", when="implicit")  # mass plus inertia of grabs
    edge_block = declare(EDGE, REAL, (3, 3), when="implicit")
    edge_normal = declare(EDGE, REAL, 3, when="solves_bonds")  # normal in the last evaluation of forces
    edge_compared = declare(EDGE, REAL, 3, unit="m", when="solves_bonds")
    # Terms for `rigid_rotation`: K W of each particle, W^T K W, the inverse inertia tensor, and the centre of
    # mass relative to the first particle. W maps an angular velocity to velocities.
    particle_turning = declare(PARTICLE, REAL, (3, 3), when="implicit")
    body_turning = declare(BODY, REAL, (3, 3), when="implicit")
    body_inverse_inertia = declare(BODY, REAL, (3, 3), unit="1/(kg m^2)", when="implicit")
    body_center = declare(BODY, REAL, 3, unit="m", when="implicit")
    solution = declare(PARTICLE, REAL, 3, unit="m/s", when="implicit")  # change of velocity
    residual = declare(PARTICLE, REAL, 3, when="implicit")
    direction = declare(PARTICLE, REAL, 3, when="implicit")
    image = declare(PARTICLE, REAL, 3, when="implicit")
    # `particle_contact` is 1 + the index of the collider that constrains the particle, or 0 if no collider
    # does. `prev_contact` is the value before the step.
    particle_contact = declare(
        PARTICLE, ti.i32, start=0, keep=PARTICLE, below=Below(COLLIDER, 1), native=True, when="implicit"
    )
    prev_contact = declare(PARTICLE, ti.i32, when="implicit")
    # Constraint of a particle in contact, see `held_particles`. `particle_hold` is the normal, and STICKS or
    # SLIDES. `hold_velocity` is the velocity of the surface. `hold_friction` acts on a sliding particle.
    particle_hold = declare(PARTICLE, REAL, 4, when="implicit")
    hold_velocity = declare(PARTICLE, REAL, 3, unit="m/s", when="implicit")
    hold_friction = declare(PARTICLE, REAL, 3, unit="N s", when="implicit")
    # Largest residual of the solves in the last step, divided by the load.
    body_residual = declare(BODY, REAL, start=0, keep=BODY, inherited=True, when="implicit")
    solver = declare(WORLD, REAL, 2, when="implicit")  # tolerance, largest number of iterations

    # The following fields are only for the schedule `flat`.
    corner_force = declare(  # stored corner by corner in each block
        BLOCK, REAL, 4, unit="N", each=4 * LANES, when="parallel"
    )
    edge_force = declare(EDGE, REAL, 3, unit="N", when="parallel")
    particle_corners = declare(PARTICLE, ti.i32, 2, start=LOADED, when="parallel")  # range in corner_slot
    corner_slot = declare(  # row of each corner in corner_force
        BLOCK, ti.i32, each=4 * LANES, start=LOADED, when="parallel"
    )
    particle_edges = declare(PARTICLE, ti.i32, 2, start=LOADED, when="parallel")  # range in incident_edge
    incident_edge = declare(  # e if the particle is the first end of edge e, -1 - e if it is the second end
        EDGE, ti.i32, each=2, start=LOADED, when="parallel"
    )
    barrier = declare(1, ti.i32, when="parallel")

    triangle_vertices = declare(TRIANGLE, ti.i32, 3, start=LOADED)  # oriented outwards
    outer_particle = declare(OUTER, ti.i32, start=LOADED)  # particles of the surface, body by body

    # Ranges of rows of each body.
    body_particles = declare(BODY, ti.i32, 2, start=LOADED)
    body_triangles = declare(BODY, ti.i32, 2, start=LOADED)
    body_outer = declare(BODY, ti.i32, 2, start=LOADED)
    body_edges = declare(BODY, ti.i32, 2, start=LOADED)
    body_edge_blocks = declare(BODY, ti.i32, 2, start=LOADED)
    body_blocks = declare(BODY, ti.i32, 2, start=LOADED, native=True)
    body_shells = declare(BODY, ti.i32, 2, start=LOADED, when="shells")
    body_model = declare(BODY, ti.i32, start=LOADED)
    body_status = declare(
        BODY, ti.i32, start=ABSENT, keep=BODY, below=Below(beside=FROZEN_DISABLED + 1), native=True
    )
    # Duration of the last substep of leapfrog. Velocities are half a substep behind positions.
    body_velocity_lag = declare(
        BODY, REAL, unit="s", start=0, keep=BODY, inherited=True, most=FINITE, native=True
    )
    # Origin of the body's positions in a step: zero near the origin of the world.
    body_origin = declare(
        BODY, REAL, 3, unit="m", start=0, keep=BODY, inherited=True, most=POSITION_LIMIT, native=True
    )
    # Bounding box that the last query computed.
    body_lower = declare(BODY, REAL, 3, unit="m")
    body_upper = declare(BODY, REAL, 3, unit="m")
    body_surface = declare(BODY, REAL, 3, start=LOADED, native=True)  # friction, thickness [m], mean edge [m]
    # Overlap with other bodies, in a world with soft contact: CLEAR, JUST_PLACED or OVERLAPPING.
    body_overlap = declare(BODY, ti.i32, start=CLEAR, keep=BODY)
    # Bounding box: of the body's path in a step while islands are searched, of its surface while contacts are
    # searched, or of the body while it sleeps or skips a step.
    body_bounds_lower = declare(BODY, REAL, 3, unit="m", keep=BODY)
    body_bounds_upper = declare(BODY, REAL, 3, unit="m", keep=BODY)
    # Rest timer: time for which no particle was faster than `sleep_speed`.
    body_calm_time = declare(BODY, REAL, unit="s", start=0, keep=BODY)
    # Bits that show what acts on the body, see `bodies.status`.
    body_drives = declare(BODY, ti.i32, start=0, keep=BODY, inherited=True, native=True)
    # Group and mask, for contact with bodies and colliders.
    body_filter = declare(BODY, ti.i32, 2, start=LOADED, keep=BODY, inherited=True, native=True)
    body_gravity_scale = declare(BODY, REAL, start=1, keep=BODY, inherited=True, most=FINITE, native=True)
    # Damping rate of velocities in the world frame.
    body_damping = declare(
        BODY, REAL, unit="1/s", start=0, keep=BODY, inherited=True, most=FINITE, native=True
    )
    # Decay rate of vibrations.
    body_fading = declare(BODY, REAL, unit="1/s", start=LOADED, keep=BODY, inherited=True)
    # Longest time between two dampings of vibrations.
    body_fading_interval = declare(BODY, REAL, unit="s", start=LOADED, keep=BODY, inherited=True)
    body_is_braked = declare(BODY, ti.i32, start=0)  # 1 in the last attempt at a step, for strong damping
    # Number of steps with inverted tetrahedra. It is negative during a restoration, see `untangling`.
    body_patience = declare(BODY, ti.i32, start=0, keep=BODY, inherited=True)
    body_jolted = declare(BODY, ti.i32, start=0)  # 1 if a step was retried because its substeps were too long
    # Number of substeps that the current shape needs, divided by the number at rest.
    body_refinement = declare(BODY, REAL, start=1, keep=BODY, inherited=True, most=FINITE)
    body_edge = declare(BODY, REAL, unit="m", start=LOADED)  # mean edge length of the surface
    # Distance that sound travels in the longest stable substep at rest.
    body_stride = declare(BODY, REAL, unit="m", start=LOADED)
    body_sound_speed = declare(BODY, REAL, unit="m/s", start=LOADED, keep=BODY, inherited=True, most=FINITE)
    # Largest number of retries of a failed step. Each retry has twice the substeps.
    retries = declare(WORLD, ti.i32)
    block_model = declare(BLOCK, ti.i32, start=LOADED)

    # Speed below which bodies fall asleep; 0 disables sleep.
    sleep_speed = declare(WORLD, REAL, unit="m/s", start=LOADED)
    gravity = declare(WORLD, REAL, 3, unit="m/s^2", native=True)
    wind = declare(  # velocity [m/s], density times drag coefficient [kg/m^3]
        WORLD, REAL, 4, start=0, keep=WORLD, most=FINITE, native=True
    )
    # Point to which drawn positions are relative, and its rounding errors: see `World.set_view_origin`.
    view_origin = declare(WORLD, REAL, 6, unit="m", start=0, native=True)
    floor = declare(WORLD, REAL, 3, native=True)  # height [m], restitution, friction

    def __init__(self, capacity: BodyCapacity) -> None:
        """Allocate fields of `capacity`, filled with zeros until `load`."""
        self.capacity = capacity
        self.programs: set[Program] = set()  # programs that used these fields
        self.loader = Loader()
        self.real = ti.f64 if capacity.double else ti.f32
        super().__init__(capacity, self.real)
        fields = [(each, field) for _, each, field in self.declared()]
        # `spawn_body` resets the fields in `body_starts`. The pieces of a cut body get that body's values of
        # the fields in `inherited`.
        self.body_starts = [
            (field, each.start)
            for each, field in fields
            if (each.rows, each.keep, each.size) == (BODY, BODY, 1) and isinstance(each.start, (int, float))
        ]
        self.inherited = [field for each, field in fields if each.inherited]

    def load(self, scene: Scene, models: list[int], kinds: NDArray[np.float64] | None = None) -> None:
        """Fill every field from `scene`, except those for which `loader` already has rows.

        `models[i]` is the index of the force model of body i. `kinds[i]` contains the values of `body_edge`,
        `body_stride`, `body_sound_speed`, `body_fading` and `body_fading_interval` for body i.

        All bodies are absent until `spawn_body` places them. Until then, their particles are at the positions
        of their meshes.
        """
        fill, ranges, bodies = self.loader.fill, scene.ranges, scene.bodies
        position = _laid_out(scene, "particles", lambda b: b.rest_position)
        fill(self.particle_position, position)
        fill(self.prev_position, position)
        fill(self.particle_mass, _laid_out(scene, "particles", lambda b: b.mass))
        inv_mass = _laid_out(scene, "particles", lambda b: 1.0 / b.mass)
        for body, place in zip(bodies, ranges, strict=True):
            inv_mass[body.pinned + place.particles[0]] = 0.0
        fill(self.particle_inv_mass, inv_mass)
        fill(self.particle_body, np.repeat(np.arange(len(bodies)), [np.diff(r.particles)[0] for r in ranges]))
        fill(self.particle_of_vertex, _laid_out(scene, "particles", lambda b: b.rank, "particles"))

        vertices, corners = _tet_blocks(bodies, ranges)
        fill(self.tet_vertices, vertices)
        inverses = _blocks(bodies, lambda b: np.swapaxes(b.rest_inverse, 1, 2), 9)
        fill(self.tet_rest_inverse, inverses)
        if self.capacity.plastic:
            fill(self.tet_original_inverse, inverses)
        constants = [self.tet_constants(body) for body in bodies]
        for number, (field, own) in enumerate(constants[0]):
            fill(field, np.concatenate([blocks_of(each[number][1], own.shape[1], 0) for each in constants]))

        edges = _laid_out(scene, "edges", lambda b: with_spare_rows(b.edge_vertices), "particles")
        fill(self.edge_vertices, edges)
        fill(self.edge_blocks, _laid_out(scene, "edge_blocks", lambda b: b.edge_blocks, "edges", columns=1))
        fill(self.edge_damping, _laid_out(scene, "edges", lambda b: with_spare_rows(b.edge_damping)))
        if self.capacity.rings:
            self._load_bonds(scene)
        if self.capacity.rings or self.capacity.implicit:
            names = [b.tet_edges + r.edges[0] for b, r in zip(bodies, ranges, strict=True)]
            # Padding lanes in the last block of a body add zero pressure to its first edge.
            rows = [blocks_of(rows, 6, r.edges[0]) for rows, r in zip(names, ranges, strict=True)]
            fill(self.tet_edges, np.concatenate(rows))
        if self.capacity.shells:
            self._load_shells(scene)
        if self.capacity.rods:
            self._load_rods(scene)
        if self.capacity.parallel:
            self._load_gather_lists(corners, edges, scene.particle_count)

        fill(self.triangle_vertices, _laid_out(scene, "triangles", lambda b: b.triangles, "particles"))
        fill(self.outer_particle, _laid_out(scene, "outer", lambda b: b.outer, "particles"))
        fill(self.body_particles, _used(scene, "particles", lambda b: b.mass))
        fill(self.body_triangles, _used(scene, "triangles", lambda b: b.triangles))
        fill(self.body_outer, _used(scene, "outer", lambda b: b.outer))
        fill(self.body_edges, _used(scene, "edges", lambda b: b.edge_vertices))
        fill(self.body_edge_blocks, _used(scene, "edge_blocks", lambda b: b.edge_blocks))
        fill(self.body_blocks, np.array([r.blocks for r in ranges]))
        fill(self.body_model, np.array(models))
        fill(self.rest_position, position)
        own = np.zeros((len(bodies), 5)) if kinds is None else kinds
        fill(self.body_edge, own[:, 0])
        fill(self.body_stride, own[:, 1])
        fill(self.body_sound_speed, own[:, 2])
        fill(self.body_fading, own[:, 3])
        fill(self.body_fading_interval, own[:, 4])
        fill(self.block_model, np.repeat(models, [r.blocks[1] - r.blocks[0] for r in ranges]))
        self.fill_starts(self.loader)
        self.loader.write()

    def tet_constants(self, body: BodyArrays) -> list[tuple[Any, NDArray[np.float64]]]:
        """Return the fields with constants of tetrahedra, and the rows of one body in each field, (m, k).

        The list is complete. Loading, `set_material` and cuts use it.
        """
        found = [(self.tet_lame, body.lame), (self.tet_damping, body.tet_damping[:, None])]
        if self.capacity.anisotropic:
            found.append((self.tet_stiffness, body.stiffness))
        if self.capacity.rings:
            found.append((self.tet_expansion_modulus, body.expansion_modulus[:, None]))
        return found

    def shell_constants(self, shells: ShellArrays) -> list[tuple[Any, NDArray[np.float64]]]:
        """Return the fields with constants of shell elements, and the rows of one body in each field, (m, k).

        The list is complete. Loading and `set_material` use it.
        """
        return [
            (self.shell_rest_inverse, shells.rest_inverse),
            (self.shell_lame, shells.lame),
            (self.shell_bending, shells.bending),
            (self.shell_bending_damping, shells.bending_damping),
        ]

    def _load_shells(self, scene: Scene) -> None:
        """Load the elements of shells. Padding lanes name the body's first particle, without stiffness."""
        fill = self.loader.fill
        bodies = [
            (b.shells, r.particles[0]) for b, r in zip(scene.bodies, scene.ranges, strict=True) if b.shells
        ]
        points = [blocks_of(shells.points + first, POINTS, first) for shells, first in bodies]
        fill(self.shell_points, np.concatenate(points))
        constants = [self.shell_constants(shells) for shells, _ in bodies]
        for number, (field, own) in enumerate(constants[0]):
            fill(field, np.concatenate([blocks_of(each[number][1], own.shape[1], 0) for each in constants]))
        fill(self.body_shells, np.array([r.shells for r in scene.ranges]))

    def _load_rods(self, scene: Scene) -> None:
        """Load the constants of rods. Rows of other bodies get zeros."""
        fill = self.loader.fill
        for field, name in ((self.rod_edge, "edges"), (self.rod_joint, "joints"), (self.rod_rest, "rest")):
            fill(field, _laid_out(scene, "particles", partial(_rod_rows, name)))
        kinds = [0 if body.rods is None else 1 + int(body.rods.is_closed) for body in scene.bodies]
        fill(self.body_rod, np.array(kinds))

    def _load_bonds(self, scene: Scene) -> None:
        """Load the constants and rings of pairwise laws. Edges of bodies with other laws get zeros."""
        fill, bodies = self.loader.fill, scene.bodies
        constants, rings, members, weights = [], [], [], []
        for body, place, rows in zip(bodies, scene.ranges, _spans(scene, "edges"), strict=True):
            bonds = body.bonds
            if bonds is None:
                constants.append(np.zeros((rows, 4)))
                rings.append(np.zeros((rows, 2), dtype=np.int32))
                continue
            names_tets = bonds.expansion_modulus is not None
            first = place.blocks[0] * LANES if names_tets else place.particles[0]
            constants.append(with_spare_rows(bonds.constants))
            rings.append(with_spare_rows(bonds.ring + place.rings[0]))
            members.append(bonds.members + first)
            weights.append(bonds.weights)
        fill(self.edge_bond, np.concatenate(constants))
        fill(self.edge_ring, np.concatenate(rings))
        fill(self.ring_members, np.concatenate(members))
        fill(self.ring_weights, np.concatenate(weights))
        fill(self.tet_inverse_volume6, _blocks(bodies, lambda b: np.linalg.det(b.rest_inverse), 1))

    def _load_gather_lists(self, corners: NDArray[np.int64], edges: NDArray[np.int64], count: int) -> None:
        """List the corner and edge forces that act on each particle, in a fixed order."""
        fill, order = self.loader.fill, np.argsort(corners[:, 0], kind="stable")
        fill(self.corner_slot, corners[order, 1])
        fill(self.particle_corners, _row_ranges(corners[:, 0], count))
        numbers = np.flatnonzero(edges[:, 0] != edges[:, 1])  # the edges without the spare rows
        ends = edges[numbers].T.reshape(-1)
        incident = np.concatenate([numbers, -1 - numbers])
        fill(self.incident_edge, incident[np.argsort(ends, kind="stable")])
        fill(self.particle_edges, _row_ranges(ends, count))


def with_spare_rows(rows: NDArray[Any]) -> NDArray[Any]:
    """Append `LANES` rows of zeros to the rows of a body's edges.

    These spare edges connect the first particle of the body with itself.
    """
    return np.concatenate([rows, np.zeros((LANES, *rows.shape[1:]), dtype=rows.dtype)])


def _rod_rows(name: str, body: BodyArrays) -> NDArray[np.float64]:
    """Return the array `name` of the `Rods` of a body, or zeros for each of its particles."""
    if body.rods is None:
        return np.zeros((len(body.mass), 4))
    rows: NDArray[np.float64] = getattr(body.rods, name)
    return rows


def _laid_out(scene: Scene, kind: str, rows_of, counted_from: str = "", columns=None):  # type: ignore[no-untyped-def]
    """Concatenate the rows of all bodies. Zeros pad the rows of each body to the length of its range.

    Args:
        counted_from: kind of rows that the result of `rows_of` contains as indices within the body. These
            indices are converted to rows of the world.
        columns: number of leading columns to convert; None for all columns.
    """
    parts = []
    for body, place, span in zip(scene.bodies, scene.ranges, _spans(scene, kind), strict=True):
        rows = np.array(rows_of(body))
        if counted_from:
            numbers = rows if columns is None else rows[:, :columns]
            numbers += getattr(place, counted_from)[0]
        parts += [rows, np.zeros((span - len(rows), *rows.shape[1:]), dtype=rows.dtype)]
    return np.concatenate(parts)


def _spans(scene: Scene, kind: str) -> NDArray[np.int64]:
    """Return the number of rows of a kind that are reserved for each body, (bodies,)."""
    starts = [getattr(place, kind)[0] for place in (*scene.ranges, scene.ends)]
    return np.diff(starts)


def _used(scene: Scene, kind: str, rows_of) -> NDArray[np.int64]:  # type: ignore[no-untyped-def]
    """Return the range of the rows of a kind that each body uses, (bodies, 2)."""
    starts = np.array([getattr(place, kind)[0] for place in scene.ranges])
    return np.stack([starts, starts + [len(rows_of(body)) for body in scene.bodies]], axis=1)


def _row_ranges(owner: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    ends = np.cumsum(np.bincount(owner, minlength=count))
    return np.stack([np.concatenate([[0], ends[:-1]]), ends], axis=1)


def _blocks(bodies: list[BodyArrays], quantity, width: int) -> NDArray[np.generic]:  # type: ignore[no-untyped-def]
    return np.concatenate([blocks_of(quantity(body).reshape(-1, width), width, 0) for body in bodies])


def _tet_blocks(
    bodies: list[BodyArrays], ranges: list[Ranges]
) -> tuple[NDArray[np.generic], NDArray[np.int64]]:
    """Return the vertices of all blocks, and the particle and the row in `corner_force` of each corner.

    Only corners on which a tetrahedron exerts a force are returned, (c, 2). Padding lanes in the last block
    of a body name its first particle four times, so they have no volume and no force.
    """
    blocks, corners = [], []
    for body, place in zip(bodies, ranges, strict=True):
        rows = body.tet_vertices + place.particles[0]
        blocks.append(blocks_of(rows, 4, place.particles[0]))
        if body.bonds is not None:
            continue
        block, lane = np.divmod(np.arange(len(rows)), LANES)
        for corner in range(4):
            slot = ((block + place.blocks[0]) * 4 + corner) * LANES + lane
            corners.append(np.stack([rows[:, corner], slot], axis=1))
    none = np.zeros((0, 2), dtype=np.int64)
    return np.concatenate(blocks), np.concatenate([none, *corners]).astype(np.int64)


_free: list[BodyFields] = []
_made: list[BodyFields] = []

Kind = TypeVar("Kind", bound=BodyFields)


@in_turn
def acquire(kind: type[Kind], capacity: BodyCapacity, program: Program) -> Kind:
    """Return free fields of a kind that can hold a capacity, or make new fields.

    The function prefers fields with compiled kernels for `program`, and then the smallest fields. If closed
    worlds that await garbage collection can contain such fields, the function collects garbage first.
    """
    fields = _best(kind, capacity, program)
    if (fields is None or program not in fields.programs) and len(_free) < len(_made):
        gc.collect()  # a reference cycle, for example through a traceback, can keep closed worlds
        fields = _best(kind, capacity, program)
    if fields is None:
        fields = make_fields(partial(kind, capacity))
        _made.append(fields)
    else:
        _free.remove(fields)
    fields.programs.add(program)
    return fields


def _best(kind: type[Kind], capacity: BodyCapacity, program: Program) -> Kind | None:
    """Return the best free fields that can hold a capacity, or None: see `acquire`."""
    fitting = [each for each in _free if type(each) is kind and each.capacity.has_room_for(capacity)]
    return min(fitting, key=lambda each: (program not in each.programs, each.capacity.rooms), default=None)


def made_fields() -> list[BodyFields]:
    """Return all fields that this process has made, used and free, in the order of creation."""
    return list(_made)


def release(fields: BodyFields) -> None:
    """Make the fields of a closed world available to new worlds."""
    _free.append(fields)
