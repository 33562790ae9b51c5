"""`SoftBody` and `Context`: a body, and the part of its world that all slices share.

Slices use `Context` and `SoftBody`, but never the `World` above them. These two classes refer to each other,
so they are in one file.
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
from taichi_soft.meshing.rigid_mesh import RigidMesh

Floats32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


RowsOf = Callable[[Any], NDArray[Any]]
"""Function that returns the rows of a field in a snapshot, as integers or float32, (rows, width)."""

SomeSlice = TypeVar("SomeSlice", bound="Slice")


class Built(Protocol):
    """Fields of a built world, and methods that read and change them."""

    state: Any
    program: Any

    def change(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call `kernel(state, *arguments)`, which changes one body, or all bodies if `slot` is -1."""

    def attempt(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call `kernel(state, *arguments)`, which can reject the change.

        This method does not wake bodies, so call `mark_modified` after a change.
        """

    def mark_modified(self, slot: int) -> None:
        """Wake the body in a slot, or all bodies if `slot` is -1, after a change of its state."""

    def read(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call `kernel(state, first, *arguments)`, which only reads; `first` is the body's first particle."""

    def rows_of(self, slot: int, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the row in the fields of each of `vertices` of the body in a slot."""

    def mark_changed(self) -> None:
        """Record that the fields have changed."""

    def wake(self, slot: int) -> None:
        """Wake the body in a slot, or all bodies if `slot` is -1."""

    def wake_near(self, lower: NDArray[Any], upper: NDArray[Any]) -> None:
        """Wake sleeping bodies near the box with the corners `lower` and `upper` [m]."""

    def box_of(self, body: SoftBody) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the box around a body, its hull and its contact layer, as lower and upper corner [m]."""

    def positions(self, body: SoftBody, alpha: float, out: NDArray[np.float32] | None) -> NDArray[np.float32]:
        """Return vertex positions, (n, 3) [m], interpolated by `alpha` between the last two steps."""

    def exact_positions(self, body: SoftBody) -> NDArray[np.float64]:
        """Return the vertex positions in float64, (n, 3) [m]."""

    def velocities(self, body: SoftBody) -> NDArray[np.float32]:
        """Return the velocities of the vertices at the time of their positions, (n, 3) [m/s]."""

    def pinned(self, body: SoftBody) -> NDArray[np.int32]:
        """Return the vertices of a body that are currently pinned, ascending."""

    def rest_inverses(self, body: SoftBody) -> NDArray[np.float64]:
        """Return the current A^-1 of each tetrahedron of a plastic body, (m, 3, 3) [1/m]."""

    def require_clear(self, body: SoftBody, points: NDArray[np.float64]) -> None:
        """Raise an OptionError if a point of a body's surface, (k, 3) [m], is too deep inside a collider."""

    def mark_joints_changed(self) -> None:
        """Record that joints between bodies have changed."""

    def find_failure(self, slot: int, failed: FailedStep) -> Failure:
        """Return the first failure of a body in the step `failed`, in which the body became non-finite.

        `slot` is the slot of the body.
        """

    def on_cut(self, body: SoftBody) -> None:
        """Record that a cut has changed the vertices of a body."""

    def on_filtered(self) -> None:
        """Record that the group or the mask of a body or a collider changed."""

    def on_placed(self, body: SoftBody) -> None:
        """Make the next step search for bodies that overlap a newly placed body."""

    def apply_settings(self, settings: Settings) -> None:
        """Apply a change of gravity or of the floor's friction."""


@dataclass(eq=False, kw_only=True)
class Context:
    """The part of a world that its slices share."""

    settings: Settings
    clock: Clock
    handles: Handles
    slots: Pools[SoftBody]
    layout: Scene
    renew_substeps: Callable[[], None]  # call this after a body's mesh or material has changed
    # Function that makes the handle of a body for the next free slot of an asset.
    make_handle: Callable[[Any, SoftBodyAsset], SoftBody]
    slices: list[Slice] = field(default_factory=list)
    fields: Built | None = None  # set by `World.build`

    @property
    def built(self) -> Built:
        """Fields of the built world. Raises: StateError before `World.build`."""
        if self.fields is None:
            raise StateError("the world is not built: call world.build() after the last add_body")
        return self.fields

    def apply_settings(self, settings: Settings) -> None:
        """Apply a change of gravity or of the floor's friction; the rest of `settings` must be unchanged."""
        self.settings = settings
        if self.fields is not None:
            self.fields.apply_settings(settings)

    def of(self, kind: type[SomeSlice]) -> SomeSlice:
        """Return the slice of a given class."""
        return next(each for each in self.slices if isinstance(each, kind))


class Slice:
    """Base class of an optional feature of a world, such as grabs. Only the slice uses the feature's data."""

    name = ""  # name of the slice's part of a snapshot
    prevents_cuts = True  # True if the slice prevents cuts and tears of the bodies that it constrains
    prevents_levels = True  # True if the slice prevents changes of level of the bodies that it constrains

    def __init__(self, context: Context) -> None:
        """Create an empty slice."""
        self._context_ref = weakref.ref(context)  # weak, so that handles do not keep the world alive

    @property
    def context(self) -> Context:
        """Context of the slice. Raises: StateError if the world no longer exists."""
        context = self._context_ref()
        if context is None:
            raise StateError("the world is gone: keep a reference to it")
        return context

    def holds(self, body: SoftBody) -> bool:
        """True if the slice constrains a body or a part of it."""
        return False

    def release_body(self, body: SoftBody) -> None:
        """Release all objects of the slice that belong to a body, before the body leaves the world."""

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Compile the kernels of the slice, by calling them for a body: see `World.warm_up`.

        Args:
            body: body to call the kernels for.
            other: second body, if there is one.
            step: function that makes a step and undoes it.
        """

    def shift_origin(self, offset: NDArray[np.float64]) -> None:
        """Subtract `offset`, (3,) [m], from the places in the slice's Python data."""

    # Methods for snapshots. The world must be built when they are called.

    def entries(self) -> list[list[Any]]:
        """Return the slice's Python data as rows of plain values."""
        return []

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """Return the serial numbers of handles in `entries`: the first value of each row."""
        return [row[0] for row in entries]

    def row_counts(self, entries: list[list[Any]]) -> dict[str, int]:
        """Return the number of rows that `entries` use in each group of stored fields, by group name."""
        return {}

    def read(self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]) -> Any:
        """Check `entries` against the bodies of the snapshot, and return the data that they describe.

        Args:
            entries: rows as `entries()` returns them.
            vertex_counts: number of vertices of the body in each slot, 0 for an empty slot.
            earlier: results of the slices before this one, by name.
        Raises: ValueError, or another exception of Python, if the rows are invalid.
        """

    def things(self, read: Any) -> dict[str, int]:
        """Return the number of objects to which fields can refer, by kind: see `field_table.Below`."""
        return {}

    def require(self, read: Any, rows_of: RowsOf) -> None:
        """Check the slice's rows of fields. Raises: ValueError if they are invalid or contradict `read`."""

    def clear(self) -> None:
        """Prepare the slice for a restore. The fields of the world are overwritten afterwards."""

    def restore(self, read: Any) -> None:
        """Restore the handles from `read`, the result of `read()`. Bodies and fields are already restored."""


@dataclass(eq=False)
class BodyRecord:
    """Internal data of a body, to which users have no access: see `record_of`."""

    description: BodyDescription  # description with the current mesh and material
    first_step: int  # step in which the body was added
    present: BodyArrays | None = None  # arrays while the material changes gradually; else None
    removed_in: int | None = None  # step in which the body was removed
    frozen_in: FailedStep | None = None
    failure: Failure | None = None  # computed at the first request
    part: CutMesh | None = None  # remaining part of the asset's mesh; None for an uncut body
    topology_version: int = 0
    skin_meshes: tuple[Any, ...] | None = None  # created at the first request
    level: int = 0  # level of detail; 0 is the finest
    friction: float | None = None  # None: the asset's friction
    # Pinned vertices at the last change of level, as vertices of the finest level.
    held: NDArray[np.int64] | None = None

    def set_topology(self, part: CutMesh | None, level: int = 0) -> None:
        """Set the level of detail, and the part of the asset's mesh that cuts have left (None if uncut)."""
        self.part, self.level = part, level
        self.topology_version += 1


class SoftBody(Handle):
    """Handle of a body, without methods that need the whole world. Users get the subclass `Body`."""

    def __init__(self, context: Context, index: int, asset: SoftBodyAsset) -> None:
        """Use `World.add_body` or `World.spawn` instead."""
        # The reference is weak, so that an unreferenced world frees its state without the garbage collector.
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
        if isinstance(self.mesh, RigidMesh):
            return f"Body({self.index}, rigid, {len(self.mesh.points)} vertices, {state})"
        kind = f"{len(self.tets)} tetrahedra" if len(self.tets) else f"{len(self.mesh.edges)} edges"
        return f"Body({self.index}, {self.vertex_count} vertices, {kind}, {state})"

    @property
    def asset(self) -> SoftBodyAsset:
        """Asset of the body; pass it to `World.spawn` for more bodies of this kind."""
        return self._asset

    @property
    def level(self) -> int:
        """Level of detail; 0 is the finest. See `set_level`."""
        return self._record.level

    @property
    def index(self) -> int:
        """Number of the body's slot in the world. `World.despawn` frees the number for another body."""
        return self._index

    @property
    def is_alive(self) -> bool:
        """False after `World.despawn` has removed the body. Reading its state then raises StateError."""
        return self._record.removed_in is None

    @property
    def mesh(self) -> BodyMesh:
        """Current mesh at rest. Cuts and changes of the level of detail replace the mesh."""
        return self._record.description.mesh

    @property
    def material(self) -> AnyMaterial:
        """Current material of the body."""
        return self._record.description.material

    @property
    def friction(self) -> float:
        """Current Coulomb coefficient of the body's surface in contact with other bodies."""
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
        """Vertices of each surface triangle, (f, 3), counterclockwise seen from outside.

        The vertices of a rigid body's surface are rows of `mesh.points`.
        """
        return np.asarray(self.mesh.triangles if isinstance(self.mesh, RigidMesh) else self.mesh.surface)

    @property
    def is_held(self) -> bool:
        """True if the body is attached to a frame or to another body, grabbed, or driven by a motor."""
        return any(each.holds(self) for each in self._context.slices)

    @property
    def topology_version(self) -> int:
        """Number of changes to the vertices and tetrahedra. After a change, read `surface` again."""
        return self._record.topology_version

    @property
    def is_cut(self) -> bool:
        """True if the body was cut or torn, so that its mesh differs from its asset's mesh."""
        return self._record.part is not None

    @property
    def vertex_origins(self) -> Ints:
        """For each vertex, its original in the asset's mesh, (n,). Cuts copy vertices."""
        part = self._record.part
        return np.arange(self.vertex_count) if part is None else part.vertices

    @property
    def tet_origins(self) -> Ints:
        """Index of each tetrahedron in the asset's mesh, (m,)."""
        part = self._record.part
        return np.arange(len(self.tets)) if part is None else part.tets

    @property
    def masses(self) -> Floats:
        """Mass of each vertex, (n,) [kg]."""
        return self._record.description.masses

    @property
    def pinned(self) -> NDArray[np.int32]:
        """Vertices that are currently pinned, ascending."""
        fields = self._context.fields
        return self._record.description.pinned if fields is None else fields.pinned(self)

    @property
    def is_frozen(self) -> bool:
        """True once the body has become non-finite. It then stays in its last finite state."""
        return self._record.frozen_in is not None

    @property
    @one_thread
    def failure(self) -> Failure | None:
        """First failure of the body; None while the body is valid.

        The first access after a failure computes this record, and compiles kernels for a few seconds.
        `World.warm_up` does not compile these kernels.
        """
        require_alive(self)
        record = self._record
        if record.frozen_in is not None and record.failure is None:
            record.failure = self._context.built.find_failure(self.index, record.frozen_in)
        return record.failure

    def positions(self, out: Floats32 | None = None) -> Floats32:
        """Return the vertex positions after the last step, float32 (n, 3) [m].

        Args:
            out: C-contiguous float32 array (n, 3) to fill and return; None: a new array.
        Raises: OptionError if `out` does not fit.
        """
        return self._context.built.positions(self, 1.0, out)

    def exact_positions(self) -> Floats:
        """Return the vertex positions after the last step in float64, (n, 3) [m].

        `positions` rounds them to float32: to 2 mm at a distance of 20 km from the origin.
        """
        return self._context.built.exact_positions(self)

    def velocities(self) -> Floats32:
        """Return the vertex velocities at the time of the positions, float32 (n, 3) [m/s].

        Leapfrog stores velocities half a substep earlier than positions. This method advances them with the
        current acceleration.
        """
        return self._context.built.velocities(self)

    @property
    def gravity_scale(self) -> float:
        """Factor by which the world's gravity is multiplied for this body."""
        fields = self._context.fields
        return 1.0 if fields is None else float(fields.state.body_gravity_scale[self.index])

    def aabb(self) -> tuple[Floats, Floats]:
        """Return the smallest and largest coordinates of the vertices, (3,) each [m].

        For a rigid body, those of the points of its surface.
        """
        positions = self.exact_positions()
        if isinstance(self.mesh, RigidMesh):
            hull = self._asset.bound_hull
            assert hull is not None
            positions = (hull.weights[:, :, None] * positions[hull.vertices]).sum(axis=1)
        return positions.min(axis=0), positions.max(axis=0)

    def center_of_mass(self) -> Floats:
        """Return the centre of mass of the body, (3,) [m]."""
        masses = self.masses
        return np.asarray(weighted_sum(masses, self.exact_positions()) / masses.sum())


# Functions for the library, not for users.


def record_of(body: SoftBody) -> BodyRecord:
    """Return the internal record of a body, which callers can change."""
    return body._record


def present_asset(body: SoftBody) -> SoftBodyAsset:
    """Return the asset of an uncut body's current level of detail."""
    return body._asset.levels[body._record.level]


def context_of(body: SoftBody) -> Context:
    """Return the context of a body. Raises: StateError if the body or its world no longer exists."""
    return body._context


def belongs_to(body: SoftBody, context: Context) -> bool:
    """True if a body was made in this context. The result stays True after the body is removed."""
    return body._context_ref() is context


def require_alive(body: SoftBody) -> None:
    """Check that a body was not removed. Raises: StateError."""
    if body._record.removed_in is not None:
        raise StateError(f"body {body.index} was removed by despawn in step {body._record.removed_in}")


def slices_against_cuts(body: SoftBody) -> list[str]:
    """Return the names of the slices that prevent a cut of a body, because they constrain it."""
    return [each.name for each in body._context.slices if each.prevents_cuts and each.holds(body)]


def redescribe(body: SoftBody, description: BodyDescription, arrays: BodyArrays) -> Ranges:
    """Replace the description and arrays of a body. Return the body's ranges of rows in the fields."""
    context = body._context
    body._record.description = description
    context.layout.bodies[body.index] = arrays
    context.renew_substeps()
    return context.layout.ranges[body.index]


def rest_inverses_of(body: SoftBody) -> Floats:
    """Return A^-1 of the current rest shape of each tetrahedron, (m, 3, 3) [1/m]."""
    fields = body._context.fields
    if body.asset.plasticity is None or fields is None:
        return body._record.description.rest_inverses
    return fields.rest_inverses(body)
