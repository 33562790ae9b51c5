"""A body, and the part of its world that all slices share.

Slices see a `Context` and `SoftBody`, never the world above them. These classes refer to each other, so they
are in one file.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.cut_mesh import CutMesh
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.failure import FailedStep, Failure
from taichi_soft.bodies.layout import BodyArrays, Ranges, Scene
from taichi_soft.bodies.slots import Pools
from taichi_soft.core.clock import Clock
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import Handle, Handles
from taichi_soft.core.residue import weighted_sum
from taichi_soft.core.settings import Settings
from taichi_soft.core.threads import one_thread
from taichi_soft.elements.materials import AnyMaterial
from taichi_soft.meshing import BodyMesh

Floats32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


RowsOf = Callable[[Any], NDArray[Any]]
"""Rows of a field in a snapshot, (rows, width): integers, or float32."""

SomeSlice = TypeVar("SomeSlice", bound="Slice")


class Built(Protocol):
    """Fields of a built world, and notifications of changes to them."""

    state: Any
    program: Any

    def change(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that changes a body, or all bodies for -1."""

    def attempt(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that can refuse: bodies stay asleep until `mark_modified`."""

    def mark_modified(self, slot: int) -> None:
        """Record that control has modified a body, or all for -1."""

    def read(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, first particle of a body, *arguments) that only reads."""

    def rows_of(self, slot: int, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Rows of a body's vertices in the fields."""

    def mark_changed(self) -> None:
        """Record that the fields were written to."""

    def wake(self, slot: int) -> None:
        """Wake a body, or all for -1."""

    def wake_near(self, lower: NDArray[Any], upper: NDArray[Any]) -> None:
        """Wake bodies that sleep within range of a box, given by two corners [m]."""

    def box_of(self, body: SoftBody) -> tuple[NDArray[Any], NDArray[Any]]:
        """Bounding box of a body and its skin now, as two corners [m]."""

    def positions(self, body: SoftBody, alpha: float, out: NDArray[np.float32] | None) -> NDArray[np.float32]:
        """Positions of the vertices, between the previous step and the last one, (n, 3) [m]."""

    def velocities(self, body: SoftBody) -> NDArray[np.float32]:
        """Velocities of the vertices at the time of their positions, (n, 3) [m/s]."""

    def pinned(self, body: SoftBody) -> NDArray[np.int32]:
        """Vertices that are pinned now, ascending."""

    def rest_inverses(self, body: SoftBody) -> NDArray[np.float64]:
        """A^-1 of each tetrahedron of a body that can have flowed, (m, 3, 3) [1/m]."""

    def require_clear(self, body: SoftBody, points: NDArray[np.float64]) -> None:
        """Check points of a body's surface, (k, 3) [m]. Raises: OptionError if a collider crushes them."""

    def mark_joints_changed(self) -> None:
        """Record that joints between bodies have changed."""

    def find_failure(self, slot: int, failed: FailedStep) -> Failure:
        """Find what failed first in the body in a slot."""

    def on_cut(self, body: SoftBody) -> None:
        """Record that a body has other vertices."""

    def on_placed(self, body: SoftBody) -> None:
        """Search for bodies that a body overlaps in the next step."""

    def apply_settings(self, settings: Settings) -> None:
        """Apply other gravity, or another friction of the floor."""


@dataclass(eq=False, kw_only=True)
class Context:
    """The part of a world that its slices share."""

    settings: Settings
    clock: Clock
    handles: Handles
    slots: Pools[SoftBody]
    layout: Scene
    renew_substeps: Callable[[], None]  # called when a body has another mesh or material
    make_handle: Callable[[Any, SoftBodyAsset], SoftBody]  # for the body in the next free slot of an asset
    slices: list[Slice] = field(default_factory=list)
    fields: Built | None = None  # set by `World.build`

    @property
    def built(self) -> Built:
        """The built world. Raises: StateError before `World.build`."""
        if self.fields is None:
            raise StateError("the world is not built: call world.build() after the last add_body")
        return self.fields

    def apply_settings(self, settings: Settings) -> None:
        """Apply other gravity, or another friction of the floor; all else in `settings` must be unchanged."""
        self.settings = settings
        if self.fields is not None:
            self.fields.apply_settings(settings)

    def of(self, kind: type[SomeSlice]) -> SomeSlice:
        """Return the slice of a kind."""
        return next(each for each in self.slices if isinstance(each, kind))


class Slice:
    """One feature that a game can switch on. Its data in a world are known here and nowhere else."""

    name = ""  # of its part of a snapshot
    prevents_cuts = True  # True if a body that it constrains cannot be cut or torn
    prevents_levels = True  # True if a body that it constrains cannot change its level of detail

    def __init__(self, context: Context) -> None:
        """Create an empty slice."""
        self._context_ref = weakref.ref(context)  # handles keep their slice alive, but not the world

    @property
    def context(self) -> Context:
        """Context of the slice. Raises: StateError if the world is gone."""
        context = self._context_ref()
        if context is None:
            raise StateError("the world is gone: keep a reference to it")
        return context

    def holds(self, body: SoftBody) -> bool:
        """True if it constrains a body or a part of one."""
        return False

    def release_body(self, body: SoftBody) -> None:
        """Release everything that is tied to a body that leaves the world."""

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Call everything that a game can do to a body, and to another one if given: see `World.warm_up`.

        Args: step: makes a step and undoes it.
        """

    # Snapshots. All of these are called in a built world.

    def entries(self) -> list[list[Any]]:
        """The slice's Python data as plain rows."""
        return []

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """Numbers of the handles that have a row: the first entry of each row."""
        return [row[0] for row in entries]

    def row_counts(self, entries: list[list[Any]]) -> dict[str, int]:
        """Number of rows in use, by `entries`, in each group of its fields that a snapshot keeps."""
        return {}

    def read(self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]) -> Any:
        """Read `entries`, checked against the bodies in each slot; 0 vertices for an empty slot.

        Args: earlier: results of the slices before this one, by name.
        Raises: ValueError, or what Python raises, if they are invalid.
        """

    def things(self, read: Any) -> dict[str, int]:
        """Numbers of things that fields may name: see `field_table.Below`."""
        return {}

    def require(self, read: Any, rows_of: RowsOf) -> None:
        """Check the rows of its fields. Raises: ValueError if they are invalid or do not match `read`."""

    def clear(self) -> None:
        """Prepare for its fields to be overwritten."""

    def restore(self, read: Any) -> None:
        """Restore handles from `read`; bodies and fields are already restored."""


@dataclass(eq=False)
class BodyRecord:
    """Internal record of a body behind the handle that a user holds: see `record_of`."""

    description: BodyDescription  # as added, or after a change of material or a cut
    first_step: int
    present: BodyArrays | None = None  # with intermediate constants, while a material is eased in
    removed_in: int | None = None  # step
    frozen_in: FailedStep | None = None
    failure: Failure | None = None  # found on the first request
    part: CutMesh | None = None  # part of the asset's mesh, after a cut
    topology_version: int = 0
    skin_meshes: tuple[Any, ...] | None = None  # made on the first request
    level: int = 0  # of detail, 0 being the finest
    friction: float | None = None  # if it differs from its asset's
    held: NDArray[np.int64] | None = None  # vertices of the finest level that pins represent

    def set_topology(self, part: CutMesh | None, level: int = 0) -> None:
        """Record the part of the asset's mesh that cuts have left, None for all of it, and the level."""
        self.part, self.level = part, level
        self.topology_version += 1


class SoftBody(Handle):
    """A body without its world. Users hold the subclass `Body`."""

    def __init__(self, context: Context, index: int, asset: SoftBodyAsset) -> None:
        """Use `World.add_body` or `World.spawn` instead."""
        # Weak, so that a dropped world returns its state without waiting for the garbage collector.
        self._context_ref = weakref.ref(context)
        self._asset = asset
        self._index = index
        self._record = BodyRecord(asset.description, context.clock.steps)

    @property
    def _context(self) -> Context:
        require_alive(self)
        context = self._context_ref()
        if context is None:
            raise StateError(f"the world of body {self.index} is gone: keep a reference to it")
        return context

    def __repr__(self) -> str:
        state = "removed" if not self.is_alive else "frozen" if self.is_frozen else "active"
        kind = f"{len(self.tets)} tetrahedra" if len(self.tets) else f"{len(self.mesh.edges)} edges"
        return f"Body({self.index}, {self.vertex_count} vertices, {kind}, {state})"

    @property
    def asset(self) -> SoftBodyAsset:
        """Asset that it shares with other bodies of its kind; `World.spawn` takes it."""
        return self._asset

    @property
    def level(self) -> int:
        """Level of detail, 0 being the finest: see `set_level`."""
        return self._record.level

    @property
    def index(self) -> int:
        """Number of its slot in the world, which another body may get after `World.despawn`."""
        return self._index

    @property
    def is_alive(self) -> bool:
        """False once `World.despawn` has removed it: queries of the world then raise StateError."""
        return self._record.removed_in is None

    @property
    def mesh(self) -> BodyMesh:
        """Rest shape, as added or after cuts."""
        return self._record.description.mesh

    @property
    def material(self) -> AnyMaterial:
        """Material, as added or set since."""
        return self._record.description.material

    @property
    def friction(self) -> float:
        """Coulomb coefficient of its surface against other bodies, of its asset or as set since."""
        own = self._record.friction
        return float(self._asset.contact.friction) if own is None else own

    @property
    def vertex_count(self) -> int:
        """Number of vertices, n."""
        return len(self._record.description.mesh.vertices)

    @property
    def tets(self) -> NDArray[np.int32]:
        """Vertices of each tetrahedron, (m, 4)."""
        return self._record.description.mesh.tets

    @property
    def surface(self) -> NDArray[np.int32]:
        """Surface triangles, outward, (f, 3)."""
        return np.asarray(self.mesh.surface)

    @property
    def is_held(self) -> bool:
        """True if it is attached to a frame or another body, grabbed, or driven by a motor."""
        return any(each.holds(self) for each in self._context.slices)

    @property
    def topology_version(self) -> int:
        """Number of changes of its vertices and tetrahedra: after a change, read `surface` again."""
        return self._record.topology_version

    @property
    def is_cut(self) -> bool:
        """True if cuts or tears have changed its mesh from that of its asset."""
        return self._record.part is not None

    @property
    def vertex_origins(self) -> Ints:
        """Vertex of the asset's mesh that each vertex is or copies, (n,)."""
        part = self._record.part
        return np.arange(self.vertex_count) if part is None else part.vertices

    @property
    def tet_origins(self) -> Ints:
        """Tetrahedron of the asset's mesh that each tetrahedron is, (m,)."""
        part = self._record.part
        return np.arange(len(self.tets)) if part is None else part.tets

    @property
    def masses(self) -> Floats:
        """Mass of each vertex, (n,) [kg]."""
        return self._record.description.masses

    @property
    def pinned(self) -> NDArray[np.int32]:
        """Vertices that are pinned now, ascending."""
        fields = self._context.fields
        return self._record.description.pinned if fields is None else fields.pinned(self)

    @property
    def is_frozen(self) -> bool:
        """True once the body became non-finite; from then on it stays in its last finite state."""
        return self._record.frozen_in is not None

    @property
    @one_thread
    def failure(self) -> Failure | None:
        """First failure, None while the body is valid. Found on the first request, not within a step.

        The first request compiles kernels, for some seconds: `World.warm_up` does not include them.
        """
        require_alive(self)
        record = self._record
        if record.frozen_in is not None and record.failure is None:
            record.failure = self._context.built.find_failure(self.index, record.frozen_in)
        return record.failure

    def positions(self, out: Floats32 | None = None) -> Floats32:
        """Vertex positions after the last step, float32 (n, 3) [m].

        Args:
            out: C-contiguous float32 array to fill and return; None makes a new one.
        Raises: OptionError if `out` does not fit.
        """
        return self._context.built.positions(self, 1.0, out)

    def velocities(self) -> Floats32:
        """Vertex velocities at the time of the positions, float32 (n, 3) [m/s].

        Leapfrog stores them half a substep behind; they are advanced with the present acceleration.
        """
        return self._context.built.velocities(self)

    @property
    def gravity_scale(self) -> float:
        """Factor of the world's gravity for this body."""
        fields = self._context.fields
        return 1.0 if fields is None else float(fields.state.body_gravity_scale[self.index])

    def aabb(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates of the vertices, (3,) each [m]."""
        positions = self.positions().astype(np.float64)
        return positions.min(axis=0), positions.max(axis=0)

    def center_of_mass(self) -> Floats:
        """Centre of mass, (3,) [m]."""
        masses = self.masses
        return np.asarray(weighted_sum(masses, self.positions().astype(np.float64)) / masses.sum())


# For the library, not for users.


def record_of(body: SoftBody) -> BodyRecord:
    """Internal record of a body, to read and to write."""
    return body._record


def present_asset(body: SoftBody) -> SoftBodyAsset:
    """Asset in the slot of an uncut body: its own, or a coarser level of it."""
    return body._asset.levels[body._record.level]


def context_of(body: SoftBody) -> Context:
    """Context of a body. Raises: StateError if the body or its world is gone."""
    return body._context


def belongs_to(body: SoftBody, context: Context) -> bool:
    """True if a body was made in a context; it can have been removed since."""
    return body._context_ref() is context


def require_alive(body: SoftBody) -> None:
    """Check that a body was not removed. Raises: StateError."""
    if body._record.removed_in is not None:
        raise StateError(f"body {body.index} was removed by despawn in step {body._record.removed_in}")


def slices_against_cuts(body: SoftBody) -> list[str]:
    """Names of the slices that constrain a body and prevent a cut."""
    return [each.name for each in body._context.slices if each.prevents_cuts and each.holds(body)]


def redescribe(body: SoftBody, description: BodyDescription, arrays: BodyArrays) -> Ranges:
    """Record another description of a body. Returns its ranges in the fields."""
    context = body._context
    body._record.description = description
    context.layout.bodies[body.index] = arrays
    context.renew_substeps()
    return context.layout.ranges[body.index]


def rest_inverses_of(body: SoftBody) -> Floats:
    """Present A^-1 of each tetrahedron at rest, (m, 3, 3) [1/m]."""
    fields = body._context.fields
    if body.asset.plasticity is None or fields is None:
        return body._record.description.rest_inverses
    return fields.rest_inverses(body)
