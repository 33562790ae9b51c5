"""A body, and the part of its world that it shares with all that a game does to it.

Slices see a `Context` and `SoftBody`, never the world that stands above them. These classes name each other,
so they stand in one file.
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
"""What a snapshot has for a field, (rows, width): whole numbers, or float32."""

SomeSlice = TypeVar("SomeSlice", bound="Slice")


class Built(Protocol):
    """A built world's fields, and what has to be said of a change to them."""

    state: Any
    program: Any

    def change(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that changes a body, or all for -1."""

    def attempt(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that may refuse: bodies sleep on until `rouse` is called."""

    def rouse(self, slot: int) -> None:
        """Take note that control has changed a body, or all for -1."""

    def read(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, first particle of a body, *arguments) that changes nothing."""

    def rows_of(self, slot: int, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Where vertices of a body lie in the fields."""

    def has_changed(self) -> None:
        """Take note that the fields were written to."""

    def wake(self, slot: int) -> None:
        """Wake a body, or all for -1."""

    def wake_near(self, lower: NDArray[Any], upper: NDArray[Any]) -> None:
        """Wake who sleeps near a box, given by two corners [m]."""

    def box_of(self, body: SoftBody) -> tuple[NDArray[Any], NDArray[Any]]:
        """Corners of a box round a body and its skin, as it is now [m]."""

    def positions(self, body: SoftBody, alpha: float, out: NDArray[np.float32] | None) -> NDArray[np.float32]:
        """Of the vertices, between the previous step and the last one, (n, 3) [m]."""

    def velocities(self, body: SoftBody) -> NDArray[np.float32]:
        """Of the vertices at the time of their positions, (n, 3) [m/s]."""

    def pinned(self, body: SoftBody) -> NDArray[np.int32]:
        """Vertices that are held now, ascending."""

    def rest_inverses(self, body: SoftBody) -> NDArray[np.float64]:
        """A^-1 of each tetrahedron of a body that may have flowed, (m, 3, 3) [1/m]."""

    def require_clear(self, body: SoftBody, points: NDArray[np.float64]) -> None:
        """Raises: OptionError where points of a body's surface, (k, 3) [m], are crushed in a collider."""

    def joints_have_changed(self) -> None:
        """Take note of who is joined to whom."""

    def find_failure(self, slot: int, failed: FailedStep) -> Failure:
        """What broke first in the body in a slot."""

    def was_cut(self, body: SoftBody) -> None:
        """Take note that a body has other vertices."""

    def was_placed(self, body: SoftBody) -> None:
        """Look for bodies that a body overlaps, in the next step."""

    def become(self, settings: Settings) -> None:
        """Have other gravity, or another friction of the floor."""


@dataclass(eq=False, kw_only=True)
class Context:
    """The small part of a world that its slices share."""

    settings: Settings
    clock: Clock
    handles: Handles
    slots: Pools[SoftBody]
    layout: Scene
    renew_substeps: Callable[[], None]  # where a body is made of something else
    take_in: Callable[
        [Any, SoftBodyAsset], SoftBody
    ]  # a new handle to what is in the next free slot of an asset
    slices: list[Slice] = field(default_factory=list)
    fields: Built | None = None  # from `World.build` on

    @property
    def built(self) -> Built:
        """Raises: StateError before `World.build`."""
        if self.fields is None:
            raise StateError("the world is not built: call world.build() after the last add_body")
        return self.fields

    def become(self, settings: Settings) -> None:
        """Have other gravity, or another friction of the floor; all else in `settings` is as it was."""
        self.settings = settings
        if self.fields is not None:
            self.fields.become(settings)

    def of(self, kind: type[SomeSlice]) -> SomeSlice:
        """The slice of a kind."""
        return next(each for each in self.slices if isinstance(each, kind))


class Slice:
    """One thing that a game switches on. What there is of it in a world is known here and nowhere else."""

    name = ""  # of its part of a snapshot
    bars_cuts = True  # whether a body that it holds is not cut and does not tear
    bars_levels = True  # whether a change of its level of detail has no place for what holds it

    def __init__(self, context: Context) -> None:
        """Nothing yet."""
        self._context_ref = weakref.ref(context)  # handles keep their slice, and no world

    @property
    def context(self) -> Context:
        """Raises: StateError where the world is gone."""
        context = self._context_ref()
        if context is None:
            raise StateError("the world is gone: keep a reference to it")
        return context

    def holds(self, body: SoftBody) -> bool:
        """Whether it holds a body, or a part of one."""
        return False

    def let_go(self, body: SoftBody) -> None:
        """Give up all that is tied to a body, which leaves the world."""

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Do to a body, and another one if there is one, all that a game may: see `World.warm_up`.

        Args: step: makes a step that is taken back.
        """

    # What a snapshot has of it. All of this is called in a world that is built.

    def entries(self) -> list[list[Any]]:
        """What Python knows of it, as plain data, in rows."""
        return []

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """Numbers of the handles that have a row: the first of each."""
        return [row[0] for row in entries]

    def row_counts(self, entries: list[list[Any]]) -> list[int]:
        """How many rows of each group of its fields `carried` are in use, by `entries`."""
        return []

    def read(self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]) -> Any:
        """Rows of `entries`, checked against the bodies that are to live in each slot, 0 vertices for nobody.

        Args: earlier: what slices before this one have read, by name.
        Raises: ValueError, or what Python raises, where they are not in order.
        """

    def require(self, read: Any, rows_of: RowsOf) -> None:
        """Raises: ValueError where the rows of its fields are not in order, or do not say what was `read`."""

    def clear(self) -> None:
        """Its fields are going to be written anew."""

    def restore(self, read: Any) -> None:
        """Let handles be as was `read`; bodies and fields are so already."""


@dataclass(eq=False)
class BodyRecord:
    """What the library keeps of a body behind the handle that a user holds: see `record_of`."""

    description: BodyDescription  # as added, or as set or cut since
    first_step: int
    present: BodyArrays | None = None  # with constants on the way to those, while a material is eased in
    removed_in: int | None = None  # step
    frozen_in: FailedStep | None = None
    failure: Failure | None = None  # once it was asked for
    part: CutMesh | None = None  # of the asset's mesh, once it was cut
    topology_version: int = 0
    skin_meshes: tuple[Any, ...] | None = None  # once they were asked for
    level: int = 0  # of detail, 0 being the finest
    friction: float | None = None  # where it was given another than its asset has
    held: NDArray[np.int64] | None = None  # of the finest level: what pins of a coarser one stand for

    def become(self, part: CutMesh | None, level: int = 0) -> None:
        """Take note of what cuts have left of the asset's mesh, None for all of it, and of its level."""
        self.part, self.level = part, level
        self.topology_version += 1


class SoftBody(Handle):
    """What is known of a body without the world that it lives in. `Body` is what users hold."""

    def __init__(self, context: Context, index: int, asset: SoftBodyAsset) -> None:
        """Made by `World.add_body` and `World.spawn`."""
        # Weak, or a world that is dropped would wait for the garbage collector to give its state back.
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
        """What it shares with other bodies of its kind; `World.spawn` takes it."""
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
        """False once `World.despawn` has removed it: what asks the world then raises StateError."""
        return self._record.removed_in is None

    @property
    def mesh(self) -> BodyMesh:
        """The rest shape, as added, or as cuts have left it."""
        return self._record.description.mesh

    @property
    def material(self) -> AnyMaterial:
        """The material, as added or set since."""
        return self._record.description.material

    @property
    def friction(self) -> float:
        """Coulomb's coefficient of its surface against other bodies, as its asset has it or as set since."""
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
        """Whether it is attached, to a frame or another body, grabbed, or driven by a motor."""
        return any(each.holds(self) for each in self._context.slices)

    @property
    def topology_version(self) -> int:
        """How often its vertices and tetrahedra have changed: where this does, read `surface` again."""
        return self._record.topology_version

    @property
    def is_cut(self) -> bool:
        """Whether it is no longer what its asset says, but what cuts have left."""
        return self._record.part is not None

    @property
    def vertex_origins(self) -> Ints:
        """The vertex of the asset's mesh that each vertex is, or is a copy of, (n,)."""
        part = self._record.part
        return np.arange(self.vertex_count) if part is None else part.vertices

    @property
    def tet_origins(self) -> Ints:
        """The tetrahedron of the asset's mesh that each one is, (m,)."""
        part = self._record.part
        return np.arange(len(self.tets)) if part is None else part.tets

    @property
    def masses(self) -> Floats:
        """Mass of each vertex, (n,) [kg]."""
        return self._record.description.masses

    @property
    def pinned(self) -> NDArray[np.int32]:
        """Vertices that are held now, ascending."""
        fields = self._context.fields
        return self._record.description.pinned if fields is None else fields.pinned(self)

    @property
    def is_frozen(self) -> bool:
        """True once the body went non-finite; it stays in its last finite state from then on."""
        return self._record.frozen_in is not None

    @property
    @one_thread
    def failure(self) -> Failure | None:
        """What broke first, None while the body is sound. Found out when first asked, not within a step.

        What finds it out compiles then, for some seconds: `World.warm_up` leaves it out.
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

        Leapfrog keeps them half a substep behind; they are brought up with the present acceleration.
        """
        return self._context.built.velocities(self)

    @property
    def gravity_scale(self) -> float:
        """By what the world's gravity is multiplied for this body."""
        fields = self._context.fields
        return 1.0 if fields is None else float(fields.state.body_gravity_scale[self.index])

    def aabb(self) -> tuple[Floats, Floats]:
        """Least and greatest coordinates of the vertices, (3,) each [m]."""
        positions = self.positions().astype(np.float64)
        return positions.min(axis=0), positions.max(axis=0)

    def center_of_mass(self) -> Floats:
        """(3,) [m]."""
        masses = self.masses
        return np.asarray(weighted_sum(masses, self.positions().astype(np.float64)) / masses.sum())


# What the library asks of a body, and no user does.


def record_of(body: SoftBody) -> BodyRecord:
    """What is kept of a body, to read and to write."""
    return body._record


def present_asset(body: SoftBody) -> SoftBodyAsset:
    """What fills the slot of a body that was not cut: its asset, or a coarser level of it."""
    return body._asset.levels[body._record.level]


def context_of(body: SoftBody) -> Context:
    """The context that a body lives in. Raises: StateError where the body or its world is gone."""
    return body._context


def lives_in(body: SoftBody, context: Context) -> bool:
    """Whether a body was made in a context; it may have been removed since."""
    return body._context_ref() is context


def require_alive(body: SoftBody) -> None:
    """Raises: StateError once a body was removed."""
    if body._record.removed_in is not None:
        raise StateError(f"body {body.index} was removed by despawn in step {body._record.removed_in}")


def bars_to_cut(body: SoftBody) -> list[str]:
    """Names of the slices that hold a body and could not follow a cut."""
    return [each.name for each in body._context.slices if each.bars_cuts and each.holds(body)]


def redescribe(body: SoftBody, description: BodyDescription, arrays: BodyArrays) -> Ranges:
    """Take note that a body is made of something else. Returns where it lies in the fields."""
    context = body._context
    body._record.description = description
    context.layout.bodies[body.index] = arrays
    context.renew_substeps()
    return context.layout.ranges[body.index]


def rest_inverses_of(body: SoftBody) -> Floats:
    """A^-1 of each tetrahedron at rest as it is now, (m, 3, 3) [1/m]."""
    fields = body._context.fields
    if body.asset.plasticity is None or fields is None:
        return body._record.description.rest_inverses
    return fields.rest_inverses(body)
