"""Joints: particles of one body attached to another body."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import (
    RowsOf,
    SoftBody,
    belongs_to,
    context_of,
    record_of,
    require_alive,
)
from taichi_soft.control.breaking import as_break_force, exceeds
from taichi_soft.control.change import (
    change,
    mass_of,
    named_particles,
    require_per_body,
    rows_of,
    some_particles,
)
from taichi_soft.control.embedding import Places, places_at, places_on
from taichi_soft.control.grab_patch import wave_speed
from taichi_soft.control.kernels.joints import (
    ALL_JOINTS,
    ENDS,
    HOLDERS,
    JOINT_ENDS,
    JOINT_ROWS,
    MOST_JOINTS,
    USED_JOINT_ROWS,
    end_joint,
    forget_held,
    read_joint_impulses,
    write_break_force,
    write_joint,
)
from taichi_soft.control.numbered import Numbered
from taichi_soft.core.checks import as_vector
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, handles_of, recorded, serial_of
from taichi_soft.core.serialisation import below, indices_below
from taichi_soft.core.types import JointKind, JointKindName
from taichi_soft.meshing.rigid_mesh import SIGNS, RigidMesh

DRAW = 0.25
"""Largest closing speed of a gap, as a fraction of c sqrt(f), where c is the wave speed in the body and f
is the fraction of the body's mass that the joint holds. At this speed, elements stretch by at most about a
quarter."""

SPREAD = 0.25
"""Distance of the points of a hinge, a slider or a fixed joint from its anchor, as a fraction of the rigid
body's longest extent."""


class Joint(Handle):
    """Points of a body attached to another body. Returned by `Body.attach_to` and `World.connect`."""

    def __init__(self, body: SoftBody, other: SoftBody, number: int, particles: NDArray[np.int32]) -> None:
        """Use `Body.attach_to` instead."""
        self.body = body
        self.other = other
        self.particles = particles
        self._number = number
        self._break_force: float | None = None

    def __repr__(self) -> str:
        state = "" if self.is_attached else ", released"
        count = len(self.particles)
        return f"Joint(body {self.body.index} to {self.other.index}, {count} particles{state})"

    @property
    def is_attached(self) -> bool:
        """True until the joint is released, breaks, or one of its two bodies is removed."""
        return self.body.is_alive and self._joints.by_number.get(self._number) is self

    @property
    def _joints(self) -> Joints:
        return context_of(self.body).of(Joints)

    @property
    def force(self) -> NDArray[np.float64]:
        """Mean force of `other` on `body` during the last step, (3,) [N]; 0 if a body froze in that step.

        Raises: StateError after release.
        """
        self._require_attached()
        impulse: NDArray[np.float64] = self._joints.impulses()[self._number]
        return impulse / max(context_of(self.body).clock.last_dt, 1e-30)

    @property
    def break_force(self) -> float | None:
        """Mean force during a step above which the joint breaks [N]; None if it never breaks."""
        return self._break_force

    @recorded
    def set_break_force(self, force: float | None) -> None:
        """Change the force at which the joint breaks: see `Body.attach_to`.

        Args:
            force: force above 0 [N]; None for a joint that never breaks.
        Raises: OptionError for a number out of range; StateError after release.
        """
        limit = as_break_force(force)
        self._require_attached()
        self._break_force = limit
        write_break_force(context_of(self.body).built.state, self._number, limit or 0.0)

    @recorded
    def release(self) -> None:
        """Release the particles, which keep their velocity.

        Raises: StateError if already released.
        """
        self._require_attached()
        self._joints.end(self._number)

    def _require_attached(self) -> None:
        if not self.is_attached:
            raise StateError(
                f"this joint of bodies {self.body.index} and {self.other.index} was released: attach again"
            )


class Joints(Numbered[Joint]):
    """All joints of one world, by number."""

    name = "joints"
    most, advice_verb = MOST_JOINTS, "release"

    @property
    def rows_in_use(self) -> int:
        """Total number of particles that all joints hold."""
        return sum(len(joint.particles) for joint in self.by_number.values())

    def holding(self, body: SoftBody) -> list[Joint]:
        """Return the joints that connect a body to another body, in either direction."""
        return [joint for joint in self.handles if body in (joint.body, joint.other)]

    def impulses(self) -> NDArray[np.float64]:
        """Return the impulse of each joint on its first body in the last step, (MOST_JOINTS, 3) [N s]."""
        rows = np.empty((MOST_JOINTS, 3), dtype=np.float32)
        read_joint_impulses(self.context.built.state, rows)
        return rows.astype(np.float64)

    def end(self, number: int) -> None:
        """Release the particles of a joint."""
        joint, built = self.by_number.pop(number), self.context.built
        built.wake(joint.other.index)
        change(joint.body, end_joint, number)
        built.mark_joints_changed()

    def break_overloaded(self, dt: float) -> list[tuple[Joint, NDArray[np.float64]]]:
        """Release the joints whose mean force in the last step of `dt` [s] exceeds their limit.

        Returns: each of these joints with its impulse on `joint.body` in that step, (3,) [N s].
        """
        limits = [(number, joint.break_force) for number, joint in self.by_number.items()]
        if all(limit is None for _, limit in limits):
            return []
        impulses, broken = self.impulses(), []
        for number, limit in sorted(limits):
            if limit is not None and exceeds(impulses[number], limit, dt):
                broken.append((self.by_number[number], impulses[number]))
                self.end(number)
        return broken

    def release_body(self, body: SoftBody) -> None:
        """Release all joints of a body."""
        for joint in self.holding(body):
            joint.release()

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Compile the kernels, by joining two bodies for a step, if there are two bodies and contact."""
        context = self.context
        if other is None or not context.built.program.has_contact:
            return
        if record_of(body).description.is_rigid:
            body, other = other, body
        with contextlib.suppress(StateError):  # if all joints are in use, the kernels are compiled already
            if record_of(body).description.is_rigid:
                joint = self.connect(body, other, "ball", body.center_of_mass(), (0.0, 0.0, 1.0))
            else:
                joint = self.join(body, other, [0], [0])
            step()
            _ = joint.force, body.velocities()
            joint.set_break_force(1.0)
            joint.release()

    def entries(self) -> list[list[Any]]:
        """List each joint's serial number, index, two bodies, held particles, and its break force, if any."""
        found = []
        for number, joint in sorted(self.by_number.items()):
            entry = [serial_of(joint), number, joint.body.index, joint.other.index, joint.particles.tolist()]
            found.append(entry if joint.break_force is None else [*entry, joint.break_force])
        return found

    def row_counts(self, entries: list[list[Any]]) -> dict[str, int]:
        """See `Slice.row_counts`."""
        rows = sum(len(entry[4]) for entry in entries)
        return {ALL_JOINTS: MOST_JOINTS, USED_JOINT_ROWS: rows, JOINT_ENDS: rows * ENDS}

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, int, int, int, float | None, NDArray[np.int32]]]:
        """See `Slice.read`. Raises: ValueError for missing bodies, or in a world without joints."""
        found = []
        for serial, number, body, other, particles, *limits in entries:
            a, b = (below(slot, len(vertex_counts)) for slot in (body, other))
            has_contact = self.context.built.program.has_contact
            if a == b or not (vertex_counts[a] and vertex_counts[b] and has_contact):
                raise ValueError("a joint has no bodies")
            held = indices_below(particles, vertex_counts[a])
            (limit,) = [as_break_force(each) for each in limits] or [None]
            found.append((int(serial), below(number, MOST_JOINTS), a, b, limit, held))
        return found

    def require(self, read: Any, rows_of: RowsOf) -> None:
        """Check that the fields agree with `read`. Raises: ValueError."""
        if not self.context.built.program.has_contact:
            return
        fields = self.context.built.state.joints
        bodies, rows = rows_of(fields.bodies), rows_of(fields.rows)
        limits = rows_of(fields.break_force)
        noted = {number: (a + 1, b + 1, len(p), limit or 0.0) for _, number, a, b, limit, p in read}
        used = np.flatnonzero(bodies[:, 0])
        told = {
            int(j): (*bodies[j].tolist(), int(rows[j, 1] - rows[j, 0]), float(limits[j].item())) for j in used
        }
        spans = sorted(rows[used].tolist())
        ends = [0, *(end for _, end in spans)]
        if told != noted or [start for start, _ in spans] != ends[:-1]:
            raise ValueError("its joints differ from its fields")

    def clear(self) -> None:
        """Clear the marks of held particles. Each step marks the held particles again."""
        if self.context.built.program.has_contact:
            forget_held(self.context.built.state)

    def restore(self, read: Any) -> None:
        """Replace all joints by the joints from `read`."""
        self.by_number.clear()
        for serial, number, a, b, limit, particles in read:
            body, other = (self.context.slots.slots[slot] for slot in (a, b))
            assert body is not None
            assert other is not None
            joint = self.context.handles.find(serial, Joint) or Joint(body, other, number, particles)
            self.context.handles.enlist(joint, serial)
            joint.body, joint.other, joint._number, joint.particles = body, other, number, particles
            joint._break_force = limit
            self.by_number[number] = joint
        self.context.built.mark_joints_changed()

    def join(
        self,
        body: SoftBody,
        other: Any,
        particles: ArrayLike,
        onto: ArrayLike | None,
        break_force: float | None = None,
    ) -> Joint:
        """Implement `Body.attach_to`."""
        limit = as_break_force(break_force)
        self._require_partner(body, other)
        if record_of(body).description.is_rigid:
            raise OptionError(f"body {body.index} is rigid: use world.connect, which takes a point")
        vertices, places = _find_places(body, other, particles, onto)
        carriers = np.repeat(vertices[:, None], HOLDERS, axis=1)
        own = Places(carriers, np.repeat([[1.0, 0.0, 0.0, 0.0]], len(vertices), axis=0))
        return self._add(body, other, vertices, own, places, np.zeros(3), limit)

    def connect(
        self,
        body: SoftBody,
        other: Any,
        kind: JointKindName,
        anchor: ArrayLike,
        axis: ArrayLike,
        break_force: float | None = None,
    ) -> Joint:
        """Implement `World.connect`."""
        limit = as_break_force(break_force)
        self._require_partner(body, other)
        chosen = JointKind.parse(kind)
        at, along = as_vector(anchor, "anchor", "m"), as_vector(axis, "axis", "m")
        if not _length(along) > 0.0:
            raise OptionError("axis has zero length: pass a direction of any other length")
        along = along / _length(along)
        described = record_of(body).description
        if not isinstance(described.mesh, RigidMesh):
            raise OptionError(f"body {body.index} is not rigid: use attach_to, or give the rigid body first")
        partner = record_of(other).description.mesh
        if chosen is JointKind.SLIDER and not isinstance(partner, RigidMesh):
            raise OptionError(f"body {other.index} is not rigid: a slider connects two rigid bodies")
        size = SPREAD * float(np.ptp(described.mesh.points, axis=0).max())
        points = np.asarray(at + size * _spread(chosen, along))
        names = [f"the joint at {point.round(4).tolist()} m" for point in points]
        own, theirs = places_at(body, points, names), places_at(other, points, names)
        free_axis = np.zeros(3)
        if chosen is JointKind.SLIDER:
            assert isinstance(partner, RigidMesh)
            corners = SIGNS[:, :, None] * other.positions().astype(np.float64)[:, None, :]
            axes = corners.sum(axis=0)  # along the principal axes
            free_axis = np.array([row[0] * along[0] + row[1] * along[1] + row[2] * along[2] for row in axes])
            free_axis = free_axis / (4.0 * partner.radii)
            free_axis = free_axis / _length(free_axis)
        return self._add(body, other, np.arange(len(points), dtype=np.int32), own, theirs, free_axis, limit)

    def _require_partner(self, body: SoftBody, other: Any) -> None:
        if not isinstance(other, SoftBody) or other is body or not belongs_to(other, self.context):
            raise OptionError(f"other must be another body of the same world, got {other!r}")
        require_alive(other)

    def _add(
        self,
        body: SoftBody,
        other: SoftBody,
        vertices: NDArray[np.int32],
        own: Places,
        theirs: Places,
        axis: NDArray[np.float64],
        break_force: float | None,
    ) -> Joint:
        """Add a joint of points of `body`, `own`, to points of `other`, `theirs`.

        Raises: StateError if too many joints or rows are in use, or the schedule has no joints.
        """
        context = self.context
        require_per_body(context, "joints")
        free = self.free_number()
        used = self.rows_in_use
        if used + len(vertices) > JOINT_ROWS:
            raise StateError(
                f"the joints of a world have at most {JOINT_ROWS} particles: {used} are in use, and "
                f"{len(vertices)} more were requested. Release a joint, or give fewer"
            )
        context.built.wake(other.index)
        held = np.concatenate([rows_of(body, own.vertices), rows_of(other, theirs.vertices)], axis=1)
        weights = np.concatenate([own.weights, -theirs.weights], axis=1).astype(np.float32)
        speed = min(_follow_speed(body, own), _follow_speed(other, theirs))
        change(
            body,
            write_joint,
            free,
            body.index,
            other.index,
            used,
            DRAW * speed,
            axis.astype(np.float32),
            held,
            weights,
        )
        joint = self.by_number[free] = Joint(body, other, free, vertices)
        joint._break_force = break_force
        if break_force is not None:
            write_break_force(context.built.state, free, break_force)
        handles_of(body).enlist(joint)
        context.built.mark_joints_changed()
        return joint


def _spread(kind: JointKind, axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the offsets of a joint's points from its anchor, (n, 3)."""
    if kind is JointKind.BALL:
        return np.zeros((1, 3))
    if kind is JointKind.HINGE:
        return np.array([axis, -axis])
    least = np.zeros(3)
    least[np.abs(axis).argmin()] = 1.0
    across = np.cross(axis, least)
    return np.array([axis, -axis, across / _length(across)])


def _length(vector: NDArray[np.float64]) -> float:
    """Return the length of a vector. NumPy's own function rounds differently on different processors."""
    x, y, z = vector.tolist()
    return math.sqrt(x * x + y * y + z * z)


def _find_places(
    body: SoftBody, other: SoftBody, particles: ArrayLike, onto: ArrayLike | None
) -> tuple[NDArray[np.int32], Places]:
    """Return the held vertices of `body`, (n,), and their embedding in `other`. Raises: OptionError."""
    vertices = named_particles(body, particles)
    if onto is None:
        points = body.positions()[vertices].astype(np.float64)
        return vertices, places_at(other, points, [f"vertex {v} of body {body.index}" for v in vertices])
    named_particles(other, onto, "onto")
    given, partners = np.asarray(particles), np.asarray(onto)
    if len(vertices) != len(given):
        raise OptionError(f"particles has {len(given) - len(vertices)} vertices twice: give each one once")
    if len(partners) != len(given):
        raise OptionError(f"onto has {len(partners)} vertices for {len(given)} particles: give one for each")
    return vertices, places_on(other, partners[np.argsort(given, kind="stable")].astype(np.int32))


def _follow_speed(body: SoftBody, places: Places) -> float:
    """Return the largest speed at which a body can follow points of it [m/s]."""
    held = np.unique(places.vertices[places.weights != 0.0])
    share = mass_of(body, held) / mass_of(body, some_particles(body, None))
    return wave_speed(record_of(body).description) * float(np.sqrt(share))
