"""Joints: particles of one body attached to another body."""

from __future__ import annotations

import contextlib
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
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, handles_of, recorded, serial_of
from taichi_soft.core.serialisation import below, indices_below

DRAW = 0.25
"""Largest closing speed of a gap, as a fraction of c sqrt(f), where c is the wave speed in the body and f
is the fraction of the body's mass that the joint holds. At this speed, elements stretch by at most about a
quarter."""


class Joint(Handle):
    """Particles of a body attached to another body. Returned by `Body.attach_to`."""

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
        with contextlib.suppress(StateError):  # if all joints are in use, the kernels are compiled already
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
        context, limit = self.context, as_break_force(break_force)
        if not isinstance(other, SoftBody) or other is body or not belongs_to(other, context):
            raise OptionError(f"other must be another body of the same world, got {other!r}")
        require_alive(other)
        vertices, places = _find_places(body, other, particles, onto)
        require_per_body(context, "joints")
        free = self.free_number()
        used = self.rows_in_use
        if used + len(vertices) > JOINT_ROWS:
            raise StateError(
                f"the joints of a world have at most {JOINT_ROWS} particles: {used} are in use, and "
                f"{len(vertices)} more were requested. Release a joint, or give fewer"
            )
        context.built.wake(other.index)
        held = np.concatenate([rows_of(body, vertices)[:, None], rows_of(other, places.vertices)], axis=1)
        weights = np.concatenate([np.ones((len(vertices), 1)), -places.weights], axis=1).astype(np.float32)
        change(
            body,
            write_joint,
            free,
            body.index,
            other.index,
            used,
            _draw_speed(body, other, vertices, places),
            held,
            weights,
        )
        joint = self.by_number[free] = Joint(body, other, free, vertices)
        joint._break_force = limit
        if limit is not None:
            write_break_force(context.built.state, free, limit)
        handles_of(body).enlist(joint)
        context.built.mark_joints_changed()
        return joint


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


def _draw_speed(body: SoftBody, other: SoftBody, vertices: NDArray[np.int32], places: Places) -> float:
    """Return the largest closing speed of a gap between two bodies [m/s]."""
    holders = np.unique(places.vertices[places.weights != 0.0])
    slowest = min(_follow_speed(body, vertices), _follow_speed(other, holders))
    return DRAW * slowest


def _follow_speed(body: SoftBody, held: NDArray[np.int32]) -> float:
    """Return the largest speed at which a body can follow its held particles [m/s]."""
    share = mass_of(body, held) / mass_of(body, some_particles(body, None))
    return wave_speed(record_of(body).description) * float(np.sqrt(share))
