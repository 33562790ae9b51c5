"""Taichi fields of the particles, edges and tetrahedra of bodies.

Fields exist as long as the process: Taichi compiles kernels per set of fields, and destroying a field stalls
a running game. A closed world therefore returns its fields, and the next world that fits into them reuses
them with their compiled kernels.
"""

import gc
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.capacity import BodyCapacity
from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.layout import BodyArrays, Ranges, Scene, blocks_of
from taichi_soft.bodies.status import ABSENT
from taichi_soft.core.constants import LANES
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.runtime import holds_fields, make_fields, ti
from taichi_soft.core.threads import in_turn


@holds_fields
class BodyFields:
    """Particles, edges, tetrahedra and bodies, with one field for each quantity.

    Tetrahedra lie in blocks of `LANES`, quantity by quantity: entry k of lane l in block b of a quantity
    with K entries is at (b K + k) LANES + l. The arrays are flat because Taichi 1.7 confuses stores at a
    constant index with loads at a computed one in fields of several dimensions.
    """

    def __init__(self, capacity: BodyCapacity) -> None:
        """Allocate fields of `capacity`; contents are zero until `load`."""
        self.capacity = capacity
        self.programs: set[Program] = set()  # programs that used these fields
        self.loader = Loader()
        n, k, b, bodies = capacity.particles, capacity.edges, capacity.blocks, capacity.bodies
        real = self.real = ti.f64 if capacity.double else ti.f32
        self.particle_position = ti.Vector.field(3, real, n)  # [m]
        self.particle_velocity = ti.Vector.field(3, real, n)  # [m/s], see body_velocity_lag
        # [N], zero between steps; with a fourth component, because four floats load and store at once.
        self.particle_force = ti.Vector.field(4, real, n)
        self.particle_mass = ti.field(real, n)  # [kg]
        self.particle_inv_mass = ti.field(real, n)  # [1/kg], 0 where pinned
        self.particle_body = ti.field(ti.i32, n)
        self.particle_of_vertex = ti.field(ti.i32, n)  # particle of each of the caller's vertices
        self.prev_position = ti.Vector.field(3, real, n)  # before the last fixed step
        self.prev_velocity = ti.Vector.field(3, real, n)
        self.rest_position = ti.Vector.field(3, real, n)  # [m]
        self.particle_aim = ti.field(ti.i32, n)  # target of a pinned particle: see `control.kernels.pins`
        self.particle_target = ti.Vector.field(
            3, real, n
        )  # position of the target [m], in world or frame axes
        self.particle_push = ti.Vector.field(3, real, n)  # external force [N], if the body is `PUSHED`
        self.particle_reaction = ti.Vector.field(
            3, real, n
        )  # [N s], reaction on its constraint in the last step
        self.prev_reaction = ti.Vector.field(3, real, n)  # the same before the step

        self.tet_vertices = ti.field(ti.i32, b * 4 * LANES)
        self.tet_rest_inverse = ti.field(real, b * 9 * LANES)  # [1/m], column by column
        if capacity.plastic:
            self.tet_original_inverse = ti.field(real, b * 9 * LANES)  # [1/m], before any plastic flow
            self.body_plasticity = ti.Vector.field(4, real, bodies)  # see `Plasticity.row`
        self.tet_lame = ti.field(real, b * 2 * LANES)  # [Pa]
        if capacity.anisotropic:
            self.tet_stiffness = ti.field(real, b * 21 * LANES)  # [Pa], upper triangle row by row
        self.tet_damping = ti.field(real, b * LANES)  # [N s/m], for damping by the mean velocity

        self.edge_vertices = ti.Vector.field(2, ti.i32, k, layout=ti.Layout.SOA)
        self.edge_blocks = ti.Vector.field(2, ti.i32, k)  # first row and number of each block
        self.edge_damping = ti.field(real, k)  # [N s/m]
        if capacity.rings:
            self.edge_bond = ti.Vector.field(4, real, k, layout=ti.Layout.SOA)  # see `laws.bonds.Bonds`
            self.edge_ring = ti.Vector.field(2, ti.i32, k)  # range in the rings
            self.ring_members = ti.Vector.field(
                4, ti.i32, capacity.rings
            )  # particles, or slots of tetrahedra
            self.ring_weights = ti.Vector.field(4, real, capacity.rings)
            self.tet_inverse_volume6 = ti.field(real, b * LANES)  # 1 / (6 V0) [1/m^3]
            self.tet_expansion_modulus = ti.field(real, b * LANES)  # E nu [Pa]
            self.tet_pressure = ti.field(real, b * LANES)  # E nu dV / V0 [Pa]
            self.edge_pressure = ti.field(real, k)  # [Pa], of all tetrahedra around an edge
        if capacity.rings or capacity.implicit:
            self.tet_edges = ti.field(ti.i32, b * 6 * LANES)
        if capacity.implicit:
            self.particle_block = ti.Matrix.field(3, 3, real, n)  # diagonal blocks of the system
            self.particle_block_inverse = ti.Matrix.field(3, 3, real, n)
            self.particle_inertia = ti.field(real, n)  # [kg]: mass, plus the inertia of grabs
            self.edge_block = ti.Matrix.field(3, 3, real, k)  # row of the first end, column of the second
            if capacity.rings:  # from the last evaluation of forces
                self.edge_normal = ti.Vector.field(3, real, k)
                self.edge_compared = ti.Vector.field(3, real, k)  # [m]
            # Prepared by `rigid_rotation`: K W by particle, W^T K W, and the centre relative to the first
            # particle.
            self.particle_turning = ti.Matrix.field(3, 3, real, n)
            self.body_turning = ti.Matrix.field(3, 3, real, bodies)
            self.body_inverse_inertia = ti.Matrix.field(3, 3, real, bodies)  # [1/(kg m^2)]
            self.body_center = ti.Vector.field(3, real, bodies)  # [m]
            self.solution = ti.Vector.field(3, real, n)  # change of velocity [m/s]
            self.residual = ti.Vector.field(3, real, n)
            self.direction = ti.Vector.field(3, real, n)
            self.image = ti.Vector.field(3, real, n)
            # 1 if the floor holds it, or the number of a collider plus 1.
            self.particle_contact = ti.field(ti.i32, n)
            self.prev_contact = ti.field(ti.i32, n)  # before part of a step that can be undone
            # For constrained particles, see `held_particles`: the normal and 1 if they stick, velocity of the
            # surface [m/s], friction on sliding particles [N s].
            self.particle_hold = ti.Vector.field(4, real, n)
            self.hold_velocity = ti.Vector.field(3, real, n)
            self.hold_friction = ti.Vector.field(3, real, n)
            self.body_residual = ti.field(real, bodies)  # largest of the last step, relative to the load
            self.solver = ti.Vector.field(2, real, ())  # tolerance, largest number of iterations
        if capacity.parallel:
            self.corner_force = ti.Vector.field(4, real, b * 4 * LANES)  # [N], corner by corner in each block
            self.edge_force = ti.Vector.field(3, real, k)
            self.particle_corners = ti.Vector.field(2, ti.i32, n)  # range in corner_slot
            self.corner_slot = ti.field(ti.i32, b * 4 * LANES)  # row of each corner in corner_force
            self.particle_edges = ti.Vector.field(2, ti.i32, n)  # range in incident_edge
            self.incident_edge = ti.field(ti.i32, 2 * k)  # e as first end, -1 - e as second
            self.barrier = ti.field(ti.i32, 1)

        self.triangle_vertices = ti.Vector.field(3, ti.i32, capacity.triangles)  # outward
        self.outer_particle = ti.field(ti.i32, capacity.outer)  # particles of the surface, body by body

        self.body_particles = ti.Vector.field(2, ti.i32, bodies)  # range
        self.body_triangles = ti.Vector.field(2, ti.i32, bodies)
        self.body_outer = ti.Vector.field(2, ti.i32, bodies)
        self.body_edges = ti.Vector.field(2, ti.i32, bodies)
        self.body_edge_blocks = ti.Vector.field(2, ti.i32, bodies)
        self.body_blocks = ti.Vector.field(2, ti.i32, bodies)
        self.body_model = ti.field(ti.i32, bodies)
        self.body_status = ti.field(ti.i32, bodies)
        self.body_velocity_lag = ti.field(real, bodies)  # substep [s] by half of which leapfrog lags
        self.body_lower = ti.Vector.field(3, real, bodies)  # [m], bounding box at the last query that used it
        self.body_upper = ti.Vector.field(3, real, bodies)
        self.body_drives = ti.field(ti.i32, bodies)  # bits of control, see `bodies.status`
        self.body_gravity_scale = ti.field(real, bodies)
        self.body_damping = ti.field(real, bodies)  # rate for velocities relative to the world [1/s]
        self.body_fading = ti.field(real, bodies)  # decay rate of vibrations [1/s]
        self.body_fading_interval = ti.field(real, bodies)  # longest interval of damping vibrations [s]
        self.body_is_braked = ti.field(ti.i32, bodies)  # 1 during the last retry of a step
        self.body_patience = ti.field(ti.i32, bodies)  # steps with inverted tetrahedra; see `untangling`
        self.body_jolted = ti.field(ti.i32, bodies)  # 1 if a step was too coarse
        self.body_refinement = ti.field(real, bodies)  # substeps that its shape needs, over those at rest
        self.body_edge = ti.field(real, bodies)  # mean edge of its surface [m]
        self.body_stride = ti.field(
            real, bodies
        )  # distance of sound in the longest stable substep at rest [m]
        self.body_sound_speed = ti.field(real, bodies)  # [m/s]
        self.retries = ti.field(ti.i32, ())  # largest number of retries of a failed step, each twice as fine
        self.block_model = ti.field(ti.i32, b)

        self.gravity = ti.Vector.field(3, real, ())  # [m/s^2]
        self.wind = ti.Vector.field(4, real, ())  # [m/s], density times drag coefficient [kg/m^3]
        self.floor = ti.Vector.field(3, real, ())  # height [m], restitution, friction

    def load(self, scene: Scene, models: list[int], kinds: NDArray[np.float64] | None = None) -> None:
        """Fill every field from `scene`, except those for which `loader` already has rows.

        `models[i]` is the number of body i's force model, `kinds[i]` its `body_edge`, `body_stride`,
        `body_sound_speed`, `body_fading` and `body_fading_interval`.

        All bodies are absent, with particles at the positions of their meshes, until `spawn_body` places
        them.
        """
        fill, ranges, bodies = self.loader.fill, scene.ranges, scene.bodies
        position = _laid_out(scene, "particles", lambda b: b.rest_position)
        fill(self.particle_position, position)
        fill(self.prev_position, position)
        fill(self.particle_velocity, np.zeros((0, 3)))
        fill(self.prev_velocity, np.zeros((0, 3)))
        fill(self.particle_force, np.zeros((0, 4)))
        fill(self.particle_mass, _laid_out(scene, "particles", lambda b: b.mass))
        inv_mass = _laid_out(scene, "particles", lambda b: 1.0 / b.mass)
        for body, place in zip(bodies, ranges, strict=True):
            inv_mass[body.pinned + place.particles[0]] = 0.0
        fill(self.particle_inv_mass, inv_mass)
        fill(self.particle_aim, np.zeros(0))
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
            # Padding lanes of a last block act on the body's first edge without pressure.
            rows = [blocks_of(rows, 6, r.edges[0]) for rows, r in zip(names, ranges, strict=True)]
            fill(self.tet_edges, np.concatenate(rows))
        if self.capacity.implicit:
            fill(self.particle_contact, np.zeros(0))
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
        fill(self.body_status, np.full(len(bodies), ABSENT))
        fill(self.body_velocity_lag, np.zeros(0))
        fill(self.body_drives, np.zeros(0))
        fill(self.body_damping, np.zeros(0))
        fill(self.body_is_braked, np.zeros(0))
        fill(self.body_jolted, np.zeros(0))
        fill(self.body_patience, np.zeros(0))
        fill(self.body_refinement, np.ones(self.capacity.bodies))
        fill(self.rest_position, position)
        own = np.zeros((len(bodies), 5)) if kinds is None else kinds
        fill(self.body_edge, own[:, 0])
        fill(self.body_stride, own[:, 1])
        fill(self.body_sound_speed, own[:, 2])
        fill(self.body_fading, own[:, 3])
        fill(self.body_fading_interval, own[:, 4])
        fill(self.wind, np.zeros((0, 4)))
        fill(self.body_gravity_scale, np.ones(self.capacity.bodies))
        fill(self.block_model, np.repeat(models, [r.blocks[1] - r.blocks[0] for r in ranges]))
        self.loader.write()

    def tet_constants(self, body: BodyArrays) -> list[tuple[Any, NDArray[np.float64]]]:
        """Fields with constants of tetrahedra, and the rows of one body in each, (m, k).

        All constants of materials are listed here: for loading, `set_material` and cuts.
        """
        found = [(self.tet_lame, body.lame), (self.tet_damping, body.tet_damping[:, None])]
        if self.capacity.anisotropic:
            found.append((self.tet_stiffness, body.stiffness))
        if self.capacity.rings:
            found.append((self.tet_expansion_modulus, body.expansion_modulus[:, None]))
        return found

    def _load_bonds(self, scene: Scene) -> None:
        """Load the constants and rings of pairwise laws; zeros for the edges of other bodies."""
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
        fill(self.edge_pressure, np.zeros(0))

    def _load_gather_lists(self, corners: NDArray[np.int64], edges: NDArray[np.int64], count: int) -> None:
        """List the corner and edge forces that act on each particle, in a fixed order."""
        fill, order = self.loader.fill, np.argsort(corners[:, 0], kind="stable")
        fill(self.corner_slot, corners[order, 1])
        fill(self.particle_corners, _row_ranges(corners[:, 0], count))
        numbers = np.flatnonzero(edges[:, 0] != edges[:, 1])  # without the spare rows
        ends = edges[numbers].T.reshape(-1)
        incident = np.concatenate([numbers, -1 - numbers])
        fill(self.incident_edge, incident[np.argsort(ends, kind="stable")])
        fill(self.particle_edges, _row_ranges(ends, count))


def with_spare_rows(rows: NDArray[Any]) -> NDArray[Any]:
    """Append `LANES` rows of zeros to a body's edges, which lead from its first particle to itself."""
    return np.concatenate([rows, np.zeros((LANES, *rows.shape[1:]), dtype=rows.dtype)])


def _laid_out(scene: Scene, kind: str, rows_of, counted_from: str = "", columns=None):  # type: ignore[no-untyped-def]
    """Rows of all bodies, each at the start of its range and padded with zeros.

    `counted_from`: kind of rows that the numbers in them refer to, which become rows of the world; `columns`:
    how many leading columns hold such numbers, all if None.
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
    """Number of rows of a kind reserved for each body, used or not."""
    starts = [getattr(place, kind)[0] for place in (*scene.ranges, scene.ends)]
    return np.diff(starts)


def _used(scene: Scene, kind: str, rows_of) -> NDArray[np.int64]:  # type: ignore[no-untyped-def]
    """Range of the rows that each body uses, (bodies, 2)."""
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
    """Vertices of all blocks; and for each corner with a force its particle and its row in corner_force.

    Padding lanes of a last block name the body's first particle four times: no shape, no force.
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
    """Return fields of a kind and capacity: the smallest free ones, if possible with `program` compiled.

    Otherwise new fields are made. The garbage of closed worlds is collected first if that can free some.
    """
    fields = _best(kind, capacity, program)
    if (fields is None or program not in fields.programs) and len(_free) < len(_made):
        gc.collect()  # closed worlds can be kept by a cycle, such as a traceback
        fields = _best(kind, capacity, program)
    if fields is None:
        fields = make_fields(partial(kind, capacity))
        _made.append(fields)
    else:
        _free.remove(fields)
    fields.programs.add(program)
    return fields


def _best(kind: type[Kind], capacity: BodyCapacity, program: Program) -> Kind | None:
    """Best of the free fields, or None."""
    fitting = [each for each in _free if type(each) is kind and each.capacity.has_room_for(capacity)]
    return min(fitting, key=lambda each: (program not in each.programs, each.capacity.rooms), default=None)


def made_fields() -> list[BodyFields]:
    """All fields that this process has made, used or free, in order."""
    return list(_made)


def release(fields: BodyFields) -> None:
    """Return the fields of a closed world."""
    _free.append(fields)
