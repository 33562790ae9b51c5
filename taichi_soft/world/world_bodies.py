"""Methods of a world that add, spawn, remove and read bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, cast

from numpy.typing import ArrayLike

from taichi_soft.bodies.asset import Floats32, SoftBodyAsset
from taichi_soft.bodies.contact import DEFAULT_CONTACT, Contact
from taichi_soft.bodies.plasticity import Plasticity
from taichi_soft.bodies.render_mesh import RenderMesh, require_current
from taichi_soft.bodies.skin_mesh import first_skin_mesh
from taichi_soft.bodies.soft_body import SoftBody, belongs_to
from taichi_soft.bodies.stability import StableStep
from taichi_soft.bodies.tearing import Tearing
from taichi_soft.core.checks import as_number
from taichi_soft.core.errors import OptionError
from taichi_soft.core.handles import recorded
from taichi_soft.core.types import (
    DampingModel,
    DampingModelName,
    FlipsName,
    LawName,
    Overlap,
    OverlapName,
    StrainName,
)
from taichi_soft.elements.materials import AnyMaterial
from taichi_soft.meshing import BodyMesh
from taichi_soft.world.body import Body
from taichi_soft.world.spawning import add_body, despawn, require_open, require_own, reserve, spawn
from taichi_soft.world.world_parts import WorldParts


class WorldBodies(WorldParts):
    """Methods of a world that concern its bodies."""

    @property
    def bodies(self) -> Sequence[Body]:
        """All bodies, in the order of their slots. Bodies from `add_body` are in the order of the calls."""
        return cast("tuple[Body, ...]", self._context.slots.occupants)

    @property
    def slot_count(self) -> int:
        """Number of slots for bodies, including empty slots."""
        return len(self._context.slots.slots)

    def add_body(
        self,
        mesh: BodyMesh | SoftBodyAsset,
        material: AnyMaterial | None = None,
        *,
        law: LawName | None = None,
        strain: StrainName | None = None,
        flips: FlipsName | None = None,
        damping_model: DampingModelName = DampingModel.EDGE,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        on_floor: bool = False,
        pinned: ArrayLike = (),
        contact: Contact = DEFAULT_CONTACT,
        plasticity: Plasticity | None = None,
        spare_vertices: int = 0,
        tearing: Tearing | None = None,
        overlap: OverlapName = Overlap.PART,
    ) -> Body:
        """Add a body before `build`, with a slot for it.

        Bodies with the same mesh, material and options share an asset.
        Args:
            mesh: rest shape [m], or a `SoftBodyAsset`. An asset contains all options of a kind of body. With
                an asset, give only `position`, `rotation`, `velocity`, `on_floor` and `overlap`.
            material: material constants in SI units; a `SpringMaterial` for a rope or cloth of springs, a
                `ShellMaterial` for a `ShellMesh`, a `RodMaterial` for a `RodMesh`. Required with a mesh.
            law: force law, a key of `LAWS`; None uses "neo_hookean", or the law that the material and the
                options below require.
            strain: "linear" or "exact", for laws that support both; None uses the default of the law.
            flips: treatment of inverted tetrahedra: "tolerant", "recover" or "off"; None uses the default of
                the law.
            damping_model: "edge" damps along edges; "tet_mean" damps towards the mean velocity of each
                tetrahedron.
            position: position of the mesh's origin, (3,) [m]. The origin of built-in shapes is their centre;
                the origin of an artist's mesh is that of its file.
            rotation: rotation about the mesh's origin, matrix (3, 3) or quaternion (x, y, z, w); None for no
                rotation.
            velocity: velocity of all vertices that are not pinned, (3,) [m/s].
            on_floor: True places the body on the floor. Then z of `position` is the height of its lowest
                vertex, or of the lowest point of its hull, above the floor [m].
            overlap: rule for a body that starts inside another body, if bodies can touch: "part" moves the
                two bodies apart in the next steps, "refuse" raises an error.
            pinned: vertices that stay fixed.
            contact: friction, thickness and groups of the body's surface.
            plasticity: permanent deformation; None for a body without plasticity.
            spare_vertices: capacity for the vertices that `Body.cut` adds, about n^(2/3) for a cut through a
                body of n vertices; 0 for a body that cannot be cut.
            tearing: tearing by stress, which uses the spare vertices; None for a body that does not tear.
        Returns: a handle of the body.
        Raises: MeshError, MaterialError or OptionError for invalid arguments; StateError after `build`.
        Example:
            arena = World(floor=0.0)
            table = arena.add_body(box((2, 1, 0.2), (8, 4, 1)), jelly, on_floor=True)
            bowling = arena.add_body(ball, position=(-2, 0, 0.4), velocity=(5, 0, 0))
        """
        require_open(self._context)
        options: dict[str, Any] = {
            "law": law,
            "strain": strain,
            "flips": flips,
            "damping_model": damping_model,
            "pinned": pinned,
            "contact": contact,
            "plasticity": plasticity,
            "spare_vertices": spare_vertices,
            "tearing": tearing,
        }
        asset = (
            mesh
            if isinstance(mesh, SoftBodyAsset)
            else SoftBodyAsset(mesh, cast(AnyMaterial, material), **options)
        )
        if asset is mesh:
            _require_defaults(material, options)
        return add_body(self._context, asset, position, rotation, velocity, on_floor, overlap)

    def add_rigid(
        self,
        surface: Any,
        *,
        mass: float | None = None,
        density: float | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
        on_floor: bool = False,
        contact: Contact = DEFAULT_CONTACT,
        overlap: OverlapName = Overlap.PART,
    ) -> Body:
        """Add a rigid body before `build`.

        It is a `Body` with four vertices that carry its mass. Contact, events, sleep, forces, snapshots and
        pools work as for soft bodies. `Body.pose` gives its position and rotation.
        Args:
            surface: closed surface: a `TetMesh`, or a surface as for `SoftBodyAsset.rigid`.
            mass: [kg]. Give either the mass or the density.
            density: [kg/m^3].
            position: position of the surface's origin, (3,) [m].
            rotation: rotation about that origin, matrix (3, 3) or quaternion (x, y, z, w); None for no
                rotation.
            velocity: velocity of the centre of mass, (3,) [m/s].
            angular_velocity: angular velocity about the centre of mass, (3,) [rad/s].
            on_floor: True places the body on the floor, as for `add_body`.
            contact: friction, thickness and groups of the surface.
            overlap: rule for a body that starts inside another body, as for `add_body`.
        Returns: a handle of the body.
        Raises: MeshError, MaterialError or OptionError for invalid arguments; StateError after `build`.
        Example:
            arena = World(floor=0.0)
            crate = arena.add_rigid(box((0.5, 0.5, 0.5)), mass=10.0, position=(0, 0, 1))
        """
        require_open(self._context)
        asset = SoftBodyAsset.rigid(surface, mass=mass, density=density, contact=contact)
        return add_body(
            self._context, asset, position, rotation, velocity, on_floor, overlap, angular_velocity
        )

    def reserve(self, asset: SoftBodyAsset, count: int) -> None:
        """Reserve slots for `count` more bodies of an asset before `build`, for `spawn`.

        Empty slots take memory, but no time in a step.
        Args:
            asset: kind of body.
            count: number of bodies, 1 or more.
        Raises: OptionError for wrong arguments; StateError after `build`.
        """
        reserve(self._context, asset, count)

    @recorded
    def spawn(
        self,
        asset: SoftBodyAsset,
        *,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
        on_floor: bool = False,
        overlap: OverlapName = Overlap.PART,
    ) -> Body:
        """Spawn a body in the lowest free slot of its asset, before `build` or between two steps.

        Args:
            asset: asset with reserved slots, or the `asset` of an added body.
            position: position of the mesh's origin, (3,) [m]. The origin of built-in shapes is their centre;
                the origin of an artist's mesh is that of its file.
            rotation: rotation about the mesh's origin, matrix (3, 3) or quaternion (x, y, z, w); None for no
                rotation.
            velocity: velocity of the centre of mass, (3,) [m/s].
            angular_velocity: angular velocity about the centre of mass, (3,) [rad/s]. Pinned vertices are at
                rest.
            on_floor: True places the body on the floor. Then z of `position` is the height of its lowest
                vertex, or of the lowest point of its hull, above the floor [m].
            overlap: rule for a body that starts inside another body, if bodies can touch: "part" moves the
                two bodies apart in the next steps, "refuse" raises an error.
        Returns: a new handle.
        Raises: OptionError for a value or a position out of range, and for a body below the floor, inside a
            collider or, with "refuse", inside another body; StateError for an asset without slots in this
            world, or without a free slot.
        Example:
            shot = world.spawn(ball, position=(-2, 0, 1), velocity=(6, 0, 1))
            world.step(1 / 60)
            world.despawn(shot)
        """
        return spawn(self._context, asset, position, rotation, velocity, angular_velocity, on_floor, overlap)

    @recorded
    def despawn(self, body: Body) -> None:
        """Remove a body from the world. Its slot becomes free, and its handle becomes invalid.

        Args:
            body: body of this world.
        Raises: OptionError for a body of another world; StateError for a removed body.
        """
        despawn(self._context, body)

    @recorded
    def skip_step(self, bodies: Sequence[Body]) -> None:
        """Make bodies skip the next step, for example distant bodies to save time.

        The bodies keep their velocities and continue in the step after the next. A body that skips every
        other step moves at half its speed. Gravity and force fields do not act on a skipping body; impulses
        take effect when the body continues. A body makes the step after all if it is attached, near a moving
        collider or pushed by `apply_force`, if its pins have moving targets, or if another body of its island
        (see `islands`) makes the step. Sleeping and frozen bodies do not change. Further calls before the
        step add bodies.
        Args:
            bodies: bodies of this world.
        Raises: OptionError if `bodies` is not a list of this world's bodies; StateError for a removed body,
            and before `build`.
        """
        simulation = self._built
        if not isinstance(bodies, (list, tuple)):
            raise OptionError(f"bodies must be a list of this world's bodies, got {bodies!r}")
        for body in bodies:
            require_own(self._context, body)
        simulation.skip([body.index for body in bodies])

    @property
    def islands(self) -> list[tuple[Body, ...]]:
        """Islands, that is, groups of bodies that came near each other in the last step or are joined.

        Bodies can also be connected through other bodies. Each body is in exactly one island, and islands are
        sorted by slot. With `soft_contact=False` only joints form islands. A body that was spawned after the
        last step is a separate island.
        Raises: StateError before `build`.
        """
        return cast("list[tuple[Body, ...]]", self._built.islands())

    def stable_step(self, body: Body) -> StableStep:
        """Estimate the largest stable substep of a body.

        Bodies of one asset have the same estimate until they are cut or change material.

        Args:
            body: body of any world.
        Raises: OptionError if `body` is not a body.
        """
        if not isinstance(body, Body):
            raise OptionError(f"body must be a body of a world, got {body!r}")
        return self._context.substeps.stable_step(body)

    def read_positions(self, body: Body, alpha: float, out: Floats32 | None = None) -> Floats32:
        """Read the positions of a body, interpolated between the previous step (alpha 0) and the last step
        (alpha 1), (n, 3) [m]. They are relative to the point of `set_view_origin`, by default the origin.

        The first call after a step copies the positions of all bodies. Further calls with the same alpha read
        that copy, because calling a kernel takes longer than copying a thousand vertices.
        Args:
            body: body of this world.
            alpha: interpolation factor, 0 to 1.
            out: C-contiguous float32 array (n, 3) to fill and return; None allocates a new one.
        Raises: OptionError for a body of another world, an alpha out of range or an `out` that does not
            fit; StateError before `build`.
        """
        simulation = self._built
        require_own(self._context, body)
        if type(alpha) is not float or not 0.0 <= alpha <= 1.0:
            alpha = as_number(alpha, "alpha", 0.0, 1.0, "a number from 0 to 1")
        return simulation.readout.drawn_positions(body, alpha, out)

    def read_render_mesh(
        self,
        mesh: RenderMesh | SoftBody,
        alpha: float,
        positions: Floats32 | None = None,
        normals: Floats32 | None = None,
    ) -> tuple[Floats32, Floats32]:
        """Read the positions and normals of a render mesh, interpolated between the previous step (alpha 0)
        and the last step (alpha 1).

        Positions are relative to the point of `set_view_origin`, by default the origin.

        A normal is the mean of the normals of the triangles around its vertex, weighted by area, so
        degenerate triangles do not contribute. If all triangles are degenerate, the normal is (0, 0, 1). Each
        call runs one kernel.
        Args:
            mesh: render mesh of a body of this world, see `Body.render_mesh`; or a body, which means the
                first of its `render_meshes`.
            positions, normals: C-contiguous float32 arrays (k, 3) to fill; None allocates new ones.
            alpha: interpolation factor, 0 to 1.
        Returns: positions [m] and outward unit normals of the render vertices.
        Raises: OptionError for a body of another world, an alpha out of range or a buffer that does not
            fit; StateError for a body that was removed, or cut since the mesh was made, and before `build`.
        """
        simulation = self._built
        if isinstance(mesh, SoftBody):
            mesh = first_skin_mesh(mesh)
        if not isinstance(mesh, RenderMesh):
            raise OptionError(f"mesh must be a RenderMesh, made by body.render_mesh(), got {mesh!r}")
        if not belongs_to(mesh.body, self._context):
            raise OptionError(
                f"mesh must belong to a body of this world, got one of {mesh.body!r} of another"
            )
        require_current(mesh)
        if type(alpha) is not float or not 0.0 <= alpha <= 1.0:
            alpha = as_number(alpha, "alpha", 0.0, 1.0, "a number from 0 to 1")
        return simulation.readout.render_mesh(mesh, alpha, positions, normals)


def _require_defaults(material: AnyMaterial | None, options: dict[str, Any]) -> None:
    """Raise an OptionError for options that the caller passed together with an asset."""
    defaults = {field.name: field.default for field in fields(SoftBodyAsset)}
    given = [name for name, value in options.items() if value is not defaults[name]]
    if material is not None or given:
        name = "material" if material is not None else given[0]
        raise OptionError(
            f"{name} was given together with an asset, which has its own: pass it to SoftBodyAsset"
        )
