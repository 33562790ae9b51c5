"""One soft body of a world: what a user reads from it."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies import measures
from taichi_soft.bodies.failure import FailedStep, Failure
from taichi_soft.bodies.layout import BodyArrays, BodyDescription, Ranges
from taichi_soft.bodies.pose import Pose
from taichi_soft.bodies.stability import StableStep
from taichi_soft.bodies.status import SHELTERED
from taichi_soft.control.attachments import Attachment, attach, share_attachments
from taichi_soft.control.drives import (
    apply_force,
    set_gravity_scale,
    set_linear_damping,
    set_sheltered,
)
from taichi_soft.control.grabs import Grab, grab_at
from taichi_soft.control.impulses import apply_impulse, apply_impulse_at_point
from taichi_soft.control.joints import Joint, attach_to
from taichi_soft.control.materials import set_damping, set_material
from taichi_soft.control.pins import pin, pinned_vertices, set_targets, unpin
from taichi_soft.control.placement import set_velocity, teleport
from taichi_soft.core.checks import as_array, as_positive
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import Handle, recorded
from taichi_soft.core.turns import one_thread
from taichi_soft.elements.materials import AnyMaterial
from taichi_soft.events import Event, StressExceeded, TearCandidates
from taichi_soft.fracture.cutting import cut
from taichi_soft.fracture.parts import Part
from taichi_soft.meshing import BodyMesh

if TYPE_CHECKING:
    from taichi_soft.bodies.asset import SoftBodyAsset
    from taichi_soft.control.frames import Frame
    from taichi_soft.world.world import World

Floats32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Body(Handle):
    """A handle to one body. Positions and velocities come back in the caller's vertex order.

    Energies, momentum and volume are computed in float64 from the float32 state, at the time of the call.
    """

    def __init__(self, world: World, index: int, asset: SoftBodyAsset) -> None:
        """Made by `World.add_body` and `World.spawn`."""
        # Weak, or a world that is dropped would wait for the garbage collector to give its state back.
        self._world_ref = weakref.ref(world)
        self._asset = asset
        self._description = asset.description
        self._index = index
        self._first_step = world.step_count
        self._removed_in: int | None = None
        self._frozen_in: FailedStep | None = None
        self._failure: Failure | None = None
        self._attachments: list[Attachment] = []
        self._topology_version = 0
        self._part: Part | None = None  # of the asset's mesh, once it was cut

    def _require_alive(self) -> None:
        """Raises: StateError once the body was removed."""
        if self._removed_in is not None:
            raise StateError(f"body {self.index} was removed by despawn in step {self._removed_in}")

    @property
    def _world(self) -> World:
        self._require_alive()
        world = self._world_ref()
        if world is None:
            raise StateError(f"the world of body {self.index} is gone: keep a reference to it")
        return world

    def __repr__(self) -> str:
        state = "removed" if not self.is_alive else "frozen" if self.is_frozen else "active"
        kind = f"{len(self.tets)} tetrahedra" if len(self.tets) else f"{len(self.mesh.edges)} edges"
        return f"Body({self.index}, {self.vertex_count} vertices, {kind}, {state})"

    @property
    def asset(self) -> SoftBodyAsset:
        """What it shares with other bodies of its kind; `World.spawn` takes it."""
        return self._asset

    @property
    def index(self) -> int:
        """Number of its slot in the world, which another body may get after `World.despawn`."""
        return self._index

    @property
    def is_alive(self) -> bool:
        """False once `World.despawn` has removed it: what asks the world then raises StateError."""
        return self._removed_in is None

    @property
    def mesh(self) -> BodyMesh:
        """The rest shape, as added, or as cuts have left it."""
        return self._description.mesh

    @property
    def material(self) -> AnyMaterial:
        """The material, as added or set since."""
        return self._description.material

    @property
    def vertex_count(self) -> int:
        """Number of vertices, n."""
        return len(self._description.mesh.vertices)

    @property
    def tets(self) -> NDArray[np.int32]:
        """Vertices of each tetrahedron, (m, 4)."""
        return self._description.mesh.tets

    @property
    def surface(self) -> NDArray[np.int32]:
        """Surface triangles, outward, (f, 3)."""
        return np.asarray(self.mesh.surface)

    @property
    def is_held(self) -> bool:
        """Whether it is attached, to a frame or another body, or grabbed."""
        return self._is_pulled or bool(self._attachments)

    @property
    def _is_pulled(self) -> bool:
        """Whether it is grabbed, or joined to another body."""
        grabs = self._world._grabs.values()
        return bool(self._joints) or any(grab.body is self for grab in grabs)

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """What holds it to frames; of a piece that was cut or torn off, what it took along of these."""
        self._require_alive()
        return tuple(self._attachments)

    @property
    def _joints(self) -> list[Joint]:
        """Those that hold it, from either side."""
        return [joint for joint in self._world._joints.values() if self in (joint.body, joint.other)]

    @property
    def topology_version(self) -> int:
        """How often its vertices and tetrahedra have changed: where this does, read `surface` again."""
        return self._topology_version

    @property
    def is_cut(self) -> bool:
        """Whether it is no longer what its asset says, but what cuts have left."""
        return self._part is not None

    @property
    def vertex_origins(self) -> Ints:
        """The vertex of the asset's mesh that each vertex is, or is a copy of, (n,)."""
        return np.arange(self.vertex_count) if self._part is None else self._part.vertices

    @property
    def tet_origins(self) -> Ints:
        """The tetrahedron of the asset's mesh that each one is, (m,)."""
        return np.arange(len(self.tets)) if self._part is None else self._part.tets

    def _become(self, part: Part | None) -> None:
        """Take note of what cuts have left of the asset's mesh, None for all of it."""
        self._part = part
        self._topology_version += 1

    def _share_attachments(self, pieces: Sequence[tuple[Body, Ints]]) -> None:
        """As `control.attachments.share_attachments`."""
        share_attachments(self, pieces)

    def _redescribe(self, description: BodyDescription, arrays: BodyArrays) -> Ranges:
        """Take note that the body is made of something else. Returns where it lies in the fields."""
        world = self._world
        self._description = description
        world._scene.bodies[self.index] = arrays
        world._substeps.renew()
        return world._scene.ranges[self.index]

    @recorded
    def cut(
        self,
        *,
        plane: tuple[ArrayLike, ArrayLike] | None = None,
        triangle: ArrayLike | None = None,
    ) -> tuple[Body, ...]:
        """Cut the body along the faces of tetrahedra next to a plane or a triangle, as it is now.

        A face opens where the blade passes between the centres of its two tetrahedra. Vertices keep their
        numbers, copies come behind them; mass, momentum and elastic energy stay. What falls off becomes
        bodies of the same asset, which take free slots of its pool; the largest part stays this one. In a
        part, vertices and tetrahedra are counted anew in their order: `vertex_origins` tells what they were.
        What is attached to a frame stays so in every piece, copies of it as well: see `Attachment`.
        Args:
            plane: (point (3,) [m], normal (3,)), all through the body.
            triangle: corners, (3, 3) [m]; the cut ends where it ends.
        Returns: the bodies that fell off, the largest first; none where nothing does.
        Raises: OptionError for a blade without direction or area and for a body whose asset has no
            `spare_vertices`; StateError where room or slots run out, for a body that is frozen, grabbed or
            joined to another, and before `build`.
            Nothing is changed then.
        """
        return cut(self, plane, triangle)

    @property
    def masses(self) -> Floats:
        """Mass of each vertex, (n,) [kg]."""
        return self._description.masses

    @property
    def pinned(self) -> NDArray[np.int32]:
        """Vertices that are held now, ascending."""
        return pinned_vertices(self) if self._world.is_built else self._description.pinned

    @property
    def _rest_inverses(self) -> Floats:
        """A^-1 of each tetrahedron at rest as it is now, (m, 3, 3) [1/m]."""
        if self.asset.plasticity is None or not self._world.is_built:
            return self._description.rest_inverses
        return self._world._built.readout.rest_inverses(self)

    @property
    def stable_step(self) -> StableStep:
        """Estimate of the largest stable substep."""
        return self._world.stable_step(self)

    @property
    def is_frozen(self) -> bool:
        """True once the body went non-finite; it stays in its last finite state from then on."""
        return self._frozen_in is not None

    @property
    def is_asleep(self) -> bool:
        """True while the body rests and costs nothing (see `World.sleep_speed`)."""
        simulation = self._world._simulation
        return simulation is not None and simulation.is_asleep(self.index)

    @property
    @one_thread
    def failure(self) -> Failure | None:
        """What broke first, None while the body is sound. Found out when first asked, not within a step."""
        self._require_alive()
        if self._frozen_in is not None and self._failure is None:
            self._failure = self._world._built.find_failure(self.index, self._frozen_in)
        return self._failure

    @property
    def solve_residual(self) -> float | None:
        """Largest residual of the last step's implicit solves, over their right-hand sides; None before."""
        return self._world._built.solve_residual(self)

    def positions(self, out: Floats32 | None = None) -> Floats32:
        """Vertex positions after the last step, float32 (n, 3) [m].

        Args:
            out: C-contiguous float32 array to fill and return; None makes a new one.
        Raises: OptionError if `out` does not fit.
        """
        return self._world.read_positions(self, 1.0, out)

    def velocities(self) -> Floats32:
        """Vertex velocities at the time of the positions, float32 (n, 3) [m/s].

        Leapfrog keeps them half a substep behind; they are brought up with the present acceleration.
        """
        return self._world._built.readout.velocities(self)

    @recorded
    def set_motion(self, positions: ArrayLike, velocities: ArrayLike) -> None:
        """Put the body into a given state between two steps; a frozen body is active again.

        Args:
            positions: (n, 3) [m].
            velocities: (n, 3) [m/s], of the same moment.
        Raises: OptionError for wrong shapes or numbers that are not finite; StateError before `build`.
        """
        shape = (self.vertex_count, 3)
        x, v = as_array(positions, "positions", shape, "m"), as_array(velocities, "velocities", shape, "m/s")
        self._world._built.write_motion(self, x, v)
        self._frozen_in = self._failure = None

    @recorded
    def apply_force(self, force: ArrayLike, particles: ArrayLike | None = None) -> None:
        """Push throughout the coming step, all particles named with the same acceleration. Calls add up.

        Args:
            force: total, (3,) [N]. What falls to pinned particles goes to what holds them.
            particles: that it acts on; None means all.
        Raises: OptionError for bad numbers or vertices; StateError before `build` and under schedule "flat".
        """
        apply_force(self, force, particles)

    @property
    def gravity_scale(self) -> float:
        """By what the world's gravity is multiplied for this body."""
        simulation = self._world._simulation
        return 1.0 if simulation is None else float(simulation.state.body_gravity_scale[self.index])

    @recorded
    def set_gravity_scale(self, scale: float) -> None:
        """Multiply the world's gravity for this body, from now on: 0 floats, -1 rises."""
        set_gravity_scale(self, scale)

    @property
    def linear_damping(self) -> float:
        """Rate at which its velocities fade [1/s], 0 unless it was set."""
        simulation = self._world._simulation
        return 0.0 if simulation is None else float(simulation.state.body_damping[self.index])

    @property
    def is_sheltered(self) -> bool:
        """Whether no wind blows on it."""
        simulation = self._world._simulation
        drives = 0 if simulation is None else int(simulation.state.body_drives[self.index])
        return bool(drives & SHELTERED)

    @recorded
    def set_linear_damping(self, rate: float) -> None:
        """Let all velocities fade by exp(-rate t), from now on, against the world at rest [1/s].

        Raises: OptionError for a negative rate; StateError before `build` and under schedule "flat".
        """
        set_linear_damping(self, rate)

    @recorded
    def set_sheltered(self, is_sheltered: bool) -> None:
        """True keeps the wind of `World.set_wind` off this body, from now on."""
        set_sheltered(self, is_sheltered)

    @recorded
    def apply_impulse(self, impulse: ArrayLike, particles: ArrayLike | None = None) -> None:
        """Change the momentum at once; all particles named change their velocity by the same.

        Args:
            impulse: total, (3,) [N s]. What falls to pinned particles goes to what holds them.
            particles: that it acts on; None means all.
        Raises: OptionError for bad numbers or vertices; StateError before `build`. So do all that follow.
        """
        apply_impulse(self, impulse, particles)

    @recorded
    def apply_impulse_at_point(self, impulse: ArrayLike, point: ArrayLike, radius: float) -> None:
        """Change the momentum of the particles near a point, those at the distance r by (1 - (r/radius)^2)^2
        as much in velocity as one at the point.

        Args:
            impulse: total, (3,) [N s], however few particles share it.
            point: (3,) [m].
            radius: of what is moved [m].
        Raises: OptionError with the nearest distance where no particle is within reach.
        """
        apply_impulse_at_point(self, impulse, point, radius)

    @recorded
    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Set the velocities of all particles that are not pinned to those of a rigid body.

        Args:
            linear: velocity of the centre of mass, (3,) [m/s].
            angular: turn about the centre of mass, (3,) [rad/s].
        """
        set_velocity(self, linear, angular)

    @recorded
    def teleport(
        self, position: ArrayLike, rotation: ArrayLike | None = None, *, keep_velocity: bool = True
    ) -> None:
        """Move the whole body, deformed as it is, by a jump; pictures between two steps jump with it, and so
        do targets that were set for the coming step.

        Args:
            position: where its centre of mass goes, (3,) [m].
            rotation: turn about the centre of mass, from how it lies now: matrix or quaternion (x, y, z, w).
            keep_velocity: True turns velocities with the body, False stops it.
        Raises: OptionError where it would lie below the floor, or crushed in a collider.
        """
        teleport(self, position, rotation, keep_velocity)

    @recorded
    def pin(self, particles: ArrayLike) -> None:
        """Hold particles where they are, from now on."""
        pin(self, particles)

    @recorded
    def unpin(self, particles: ArrayLike | None = None) -> None:
        """Let pinned particles go, all if None, with the velocity that they were moved with last."""
        unpin(self, particles)

    @recorded
    def set_targets(self, particles: ArrayLike, positions: ArrayLike) -> None:
        """Move pinned particles by hand: in the coming step they go straight to `positions`, (n, 3) [m].

        After it they stand still, unless they are given new targets.
        Raises: OptionError for shapes that do not fit; StateError for a particle that is not pinned.
        """
        set_targets(self, particles, positions)

    @recorded
    def attach(self, particles: ArrayLike, frame: Frame, *, two_way: bool = False) -> Attachment:
        """Let particles go with a frame from now on, at the places that they have relative to it.

        Args:
            particles: vertices; pinned ones may be among them.
            frame: of the same world.
            two_way: add up what they pull the frame with: `Attachment.force` and `Attachment.torque`.
        Raises: OptionError for what is no frame of this world; StateError for a particle that is attached
            already, and for `two_way` under schedule "flat".
        """
        return attach(self, particles, frame, two_way)

    @recorded
    def attach_to(self, other: Body, particles: ArrayLike, *, onto: ArrayLike | None = None) -> Joint:
        """Let another body hold particles of this one from now on, until `Joint.release`.

        The two then move as one there, whatever their masses and stiffness: what a particle does to its place
        the place does to it, so momentum and angular momentum stay. Where they come apart all the same, as by
        `teleport`, they are drawn together no faster than they can follow. The particles and what holds them
        do not touch each other; the rest of the two bodies does, where `soft_contact` lets them. Joined
        bodies sleep and wake together; `World.despawn` of either ends the joint, a frozen one holds the other
        where it is.
        Args:
            other: of the same world, with tetrahedra unless `onto` is given.
            particles: vertices of this body; best those of the finer mesh.
            onto: vertices of `other`, one for each of `particles`, that these are drawn to. None holds each
                at the place in `other` where it is, in a tetrahedron or just outside of one.
        Raises: OptionError for what is no other body, for bad vertices, and without `onto` for those that are
            too far away; StateError before `build`, in a world without contact, under implicit Euler, and
            where the world's 64 joints, or the 2,048 particles that they may hold, are all in use.
        """
        return attach_to(self, other, particles, onto)

    @recorded
    def grab(
        self,
        triangle: int,
        barycentrics: ArrayLike = (1 / 3, 1 / 3, 1 / 3),
        *,
        frequency: float = 5.0,
        max_force: float | None = None,
    ) -> Grab:
        """Take hold of the surface: `move` pulls the body by a spring without swing, `release` lets go.

        The spring holds a patch of about a quarter of the body's size. What is more than the patch can bear
        pulls at the whole body, so that nothing is torn, whatever is asked for.
        Args:
            triangle: of `surface`.
            barycentrics: where on it, (3,).
            frequency: of the spring with the whole body on it [Hz].
            max_force: strongest pull [N]; None is ten times the body's weight on Earth.
        Raises: OptionError for bad numbers; MeshError for a body without surface; StateError before `build`,
            under schedule "flat", and where the world's 16 grabs are all in use.
        """
        return grab_at(self, triangle, barycentrics, None, frequency, max_force)

    @recorded
    def set_material(self, material: AnyMaterial) -> None:
        """Make the body of another material of the same kind, from now on, as if it had been added with it.

        Positions and velocities stay, so another density changes its momentum. `World.stable_substeps` and
        steps without given substeps reflect it at once, at the price of a new estimate (some 0.2 s for 5,000
        tetrahedra); with substeps given nothing is estimated, and nothing warns of too few.
        Args:
            material: of the type that the body has, fit for its law and mesh.
        Raises: MaterialError for another type, or constants that do not fit; StateError before `build`.
        """
        set_material(self, material)

    @recorded
    def set_damping(self, damping: float | NDArray[np.float64]) -> None:
        """Change the material's damping b [N s/m], from now on, one number or one per element.

        Raises: as `set_material`.
        """
        set_damping(self, damping)

    def volumes(self) -> Floats:
        """Signed volume of each tetrahedron, (m,) [m^3]: negative where it is flipped."""
        return measures.tet_volumes(self)

    def volume(self) -> float:
        """Volume of the body, flipped tetrahedra counted negative [m^3]."""
        return float(self.volumes().sum())

    def flipped_count(self) -> int:
        """Number of tetrahedra that are inside out."""
        return len(self.flipped_tets())

    def flipped_tets(self) -> NDArray[np.int64]:
        """Tetrahedra that are inside out, ascending."""
        return np.flatnonzero(self.volumes() < 0)

    def aabb(self) -> tuple[Floats, Floats]:
        """Least and greatest coordinates of the vertices, (3,) each [m]."""
        positions = measures.positions_of(self)
        return positions.min(axis=0), positions.max(axis=0)

    def pose(self) -> Pose:
        """The rigid motion of the rest shape that comes nearest to the body, weighted by mass.

        `mesh.vertices @ pose.rotation.T + pose.position` fits the positions best. The rotation never mirrors,
        also where the body is flat or inside out; about the axis of a straight rope it turns as little as
        possible.
        """
        return measures.pose(self)

    def center_of_mass(self) -> Floats:
        """(3,) [m]."""
        return np.asarray(self.masses @ measures.positions_of(self) / self.masses.sum())

    def momentum(self) -> Floats:
        """Linear momentum, (3,) [kg m/s]."""
        return np.asarray(self.masses @ measures.velocities_of(self))

    def angular_momentum(self) -> Floats:
        """About the world's origin, (3,) [kg m^2/s]."""
        return measures.angular_momentum(self)

    def kinetic_energy(self) -> float:
        """1/2 sum m v^2 [J]."""
        return measures.kinetic_energy(self)

    def gravitational_energy(self) -> float:
        """- sum m g.x, zero at the origin [J]."""
        return measures.gravitational_energy(self)

    def elastic_energy(self) -> float:
        """Of springs and the laws "st_venant_kirchhoff" and "neo_hookean": what deforming the body took [J].

        Of the other laws 1/2 sum V0 sigma : eps of the linear strain: an indicator, not a conserved
        energy. Their stress is not the derivative of any energy (except of another one at poisson = 1/4), so
        the total may drift without damping.
        """
        return measures.elastic_energy(self)

    def deformations(self) -> Floats:
        """Deformation gradient F = B A^-1 of each tetrahedron (thesis eq. 6.3), (m, 3, 3).

        Of a body with plasticity the elastic one, against the rest shape as it is now. So are all strains and
        stresses.
        """
        return measures.deformations(self)

    def strains(self) -> Floats:
        """Linear strain 1/2 (F F^T - I) of each tetrahedron (thesis eq. 6.7), (m, 3, 3)."""
        return measures.strains(self)

    def plastic_strains(self) -> Floats:
        """Equivalent (von Mises) logarithmic strain that each tetrahedron has for good, (m,)."""
        return measures.plastic_strains(self)

    def tet_stress(self) -> Floats:
        """Von Mises stress of each tetrahedron by Hooke's law and linear strain, (m,) [Pa]."""
        return measures.tet_stress(self)

    def watch_stress(self, threshold: float | None) -> None:
        """Record a `StressExceeded` in every step in which tetrahedra come over a stress.

        One that stays over it, or has not been below 0.9 of it since, is not named again.
        Args:
            threshold: of `tet_stress` [Pa]; None for no longer.
        Raises: OptionError if it is not above 0; MeshError for a body without tetrahedra; StateError before
            `build`. The same for `watch_tearing`.
        """
        self._watch(StressExceeded, threshold, "threshold")

    def watch_tearing(self, tear_stress: float | None) -> None:
        """Record a `TearCandidates` in every step in which tetrahedra are pulled harder than they can bear.

        Args:
            tear_stress: of the largest principal stress, which pulls; by Hooke's law and linear strain [Pa].
                None for no longer.
        """
        self._watch(TearCandidates, tear_stress, "tear_stress")

    def _watch(self, kind: type[Event], threshold: float | None, name: str) -> None:
        log = self._world._built.events
        measures.require_tets(self)
        limit = None if threshold is None else as_positive(threshold, name, "Pa")
        log.watch(kind, self, limit)

    def tet_strain(self) -> Floats:
        """Equivalent (von Mises) strain sqrt(2/3 e:e) of each tetrahedron, (m,), e the deviator of `strains`.

        The strain of a pull that keeps the volume; a change of volume alone has none.
        """
        return measures.tet_strain(self)

    def vertex_stress(self) -> Floats:
        """`tet_stress` averaged by volume over the tetrahedra round each vertex, (n,) [Pa]."""
        return measures.vertex_means(self, self.tet_stress())

    def vertex_strain(self) -> Floats:
        """`tet_strain` averaged by volume over the tetrahedra round each vertex, (n,)."""
        return measures.vertex_means(self, self.tet_strain())
