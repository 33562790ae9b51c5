"""Attachments of particles to frames, and their load on the frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import Slice, SoftBody, context_of
from taichi_soft.control.breaking import as_break_force, exceeds
from taichi_soft.control.change import change, named_particles, require_per_body, rows_of
from taichi_soft.control.frames import Frame, Frames, exact_position_of
from taichi_soft.control.kernels.pins import attach_particles, free_particles, read_reaction, write_feeling
from taichi_soft.core.checks import as_flag
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, recorded, serial_of
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.serialisation import below, indices_below
from taichi_soft.core.types import Schedule


class Attachment(Handle):
    """Particles of a body attached to a frame. Returned by `Body.attach`.

    If the body is cut or torn, the copies of its particles are also attached, and `particles` contains them.
    If the body falls apart, `body` becomes the largest piece with attached particles. Other pieces get new
    attachments, which `Body.attachments` lists. If the level of detail changes, the nearest vertices of the
    new level are attached instead.
    """

    def __init__(
        self, frames: Frames, body: SoftBody, particles: NDArray[np.int32], frame: Frame, *, two_way: bool
    ) -> None:
        """Use `Body.attach` instead."""
        self._frames = frames
        self.body = body
        self.particles = particles
        self.frame = frame
        self.two_way = two_way
        self._break_force: float | None = None

    def __repr__(self) -> str:
        state = "" if self.is_attached else ", released"
        return f"Attachment(body {self.body.index}, {len(self.particles)} particles, {self.frame!r}{state})"

    @property
    def is_attached(self) -> bool:
        """True until the attachment is released or breaks."""
        return self in self._frames.holding(self.body)

    @property
    def force(self) -> NDArray[np.float64]:
        """Mean force of the body on the frame during the last step, (3,) [N].

        The force includes the weight of the attached particles and the force that accelerates them. If the
        body is frozen, the force contains only forces of other bodies on the attached particles.
        Raises: StateError after release, or without `two_way`.
        """
        return self._load()[:3]

    @property
    def torque(self) -> NDArray[np.float64]:
        """Mean torque about the frame's origin during the last step, (3,) [N m]. Raises: as `force`."""
        return self._load()[3:]

    @property
    def break_force(self) -> float | None:
        """Mean force during a step above which the attachment breaks [N]; None if it never breaks."""
        return self._break_force

    @recorded
    def set_break_force(self, force: float | None) -> None:
        """Change the force at which the attachment breaks: see `Body.attach`.

        Args:
            force: force above 0 [N]; None for an attachment that never breaks.
        Raises: OptionError for a number out of range; StateError after release, or without `two_way`.
        """
        limit = as_break_force(force)
        self._require_attached()
        self._require_load()
        self._break_force = limit

    @recorded
    def release(self) -> None:
        """Release the particles, which keep their velocity. Raises: StateError if already released."""
        self._require_attached()
        self._end()

    def _end(self) -> None:
        body = self.body
        change(body, free_particles, rows_of(body, self.particles))
        left = self._frames.attachments[body]
        left.remove(self)
        if self.two_way and not any(each.two_way for each in left):
            change(body, write_feeling, body.index, 0)
        if not left:
            del self._frames.attachments[body]

    def _require_attached(self) -> None:
        if not self.is_attached:
            raise StateError(f"this attachment of body {self.body.index} was released: attach again")

    def _require_load(self) -> None:
        if not self.two_way:
            raise StateError("this attachment does not record its load: create it with two_way=True")

    def _impulses(self) -> NDArray[np.float64]:
        """Return impulse and angular impulse on the frame in the last step, (6,) [N s], [N m s]."""
        impulses = np.empty(6)
        rows = rows_of(self.body, self.particles)
        built = context_of(self.body).built
        built.read(self.body.index, read_reaction, rows, self.frame.position, impulses)
        return impulses

    def _load(self) -> NDArray[np.float64]:
        self._require_attached()
        self._require_load()
        return self._impulses() / max(context_of(self.body).clock.last_dt, 1e-30)


class Attachments(Slice):
    """Slice of all attachments of one world. `Frames` stores the attachments by body."""

    name = "attachments"
    prevents_cuts = False  # `share_attachments` keeps the pieces attached
    prevents_levels = False  # `levels.reattaching` attaches the new vertices

    @property
    def _frames(self) -> Frames:
        return self.context.of(Frames)

    def holds(self, body: SoftBody) -> bool:
        """True if the body is attached to a frame."""
        return bool(self._frames.holding(body))

    def release_body(self, body: SoftBody) -> None:
        """Release all attachments of a body."""
        for attachment in list(self._frames.holding(body)):
            attachment.release()

    def break_overloaded(self, dt: float) -> list[tuple[Attachment, NDArray[np.float64]]]:
        """Release the attachments whose mean force in the last step of `dt` [s] exceeds their limit.

        Returns: each of these attachments with the impulse of its frame on the body in that step, (3,) [N s].
        """
        held, broken = self._frames.attachments, []
        for body in sorted(held, key=lambda body: body.index):
            for each in list(held[body]):
                if each.break_force is not None:
                    impulse = each._impulses()[:3]
                    if exceeds(impulse, each.break_force, dt):
                        broken.append((each, -impulse))
                        each._end()
        return broken

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Compile the kernels, by attaching a free vertex to a frame and reading the load on the frame."""
        free = np.setdiff1d(np.arange(body.vertex_count), body.pinned)
        if not len(free):
            return
        frame = Frame(self._frames, np.zeros(3), None)
        self.context.handles.enlist(frame)
        is_felt = self.context.settings.schedule is not Schedule.FLAT
        held = attach(body, free[:1], frame, two_way=is_felt)
        step()
        if is_felt:
            _ = held.force, held.torque
        held.release()
        frame.remove()

    def entries(self) -> list[list[Any]]:
        """List each attachment's serial number, body, frame, flag `two_way`, particles, any break force."""
        frames, found = self._frames, []
        for body in sorted(frames.attachments, key=lambda body: body.index):
            for a in frames.attachments[body]:
                number = frames.number_of(a.frame)
                entry = [serial_of(a), body.index, number, a.two_way, a.particles.tolist()]
                found.append(entry if a.break_force is None else [*entry, a.break_force])
        return found

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, int, int, bool, NDArray[np.int32], float | None]]:
        """See `Slice.read`. Raises: ValueError for a missing body or frame."""
        rows = {row for row, (serial, _, _) in enumerate(earlier[Frames.name]) if serial != 0}
        found = []
        for serial, slot, number, two_way, particles, *limits in entries:
            count = vertex_counts[below(slot, len(vertex_counts))]
            if not count or number not in rows:
                raise ValueError("an attachment has no body or no frame")
            (limit,) = [as_break_force(each) for each in limits] or [None]
            vertices = indices_below(particles, count)
            found.append((int(serial), int(slot), int(number), bool(two_way), vertices, limit))
        return found

    def restore(self, read: Any) -> None:
        """Replace all attachments by the attachments from `read`."""
        context, frames = self.context, self._frames
        frames.attachments.clear()
        for serial, slot, number, two_way, particles, limit in read:
            body, frame = context.slots.slots[slot], frames.rows[number]
            assert body is not None
            assert frame is not None
            held = context.handles.find(serial, Attachment) or Attachment(
                frames, body, particles, frame, two_way=two_way
            )
            held.body, held.frame, held.particles, held.two_way = body, frame, particles, two_way
            held._break_force = limit
            context.handles.enlist(held, serial)
            frames.attachments.setdefault(body, []).append(held)


def attach(
    body: SoftBody, particles: ArrayLike, frame: Any, two_way: bool, break_force: float | None = None
) -> Attachment:
    """Implement `Body.attach`."""
    context = context_of(body)
    frames = context.of(Frames)
    vertices = named_particles(body, particles)
    number = frames.number_of(frame)
    feels, limit = as_flag(two_way, "two_way"), as_break_force(break_force)
    if limit is not None and not feels:
        raise OptionError(f"break_force={break_force!r} needs the load on the frame: pass two_way=True too")
    require_unattached(body, vertices)
    rows = rows_of(body, vertices)
    if feels:
        require_per_body(context, "forces on frames (two_way=True)")
    offsets = body.exact_positions()[vertices] - exact_position_of(frame)
    local = turned(offsets, frame.rotation.T.astype(np.float64)).astype(np.float32)
    change(body, attach_particles, body.index, number, int(feels), rows, local)
    frames.has_work = True
    attachment = Attachment(frames, body, vertices, frame, two_way=feels)
    attachment._break_force = limit
    context.handles.enlist(attachment)
    frames.attachments.setdefault(body, []).append(attachment)
    return attachment


def share_attachments(body: SoftBody, pieces: Sequence[tuple[SoftBody, NDArray[np.int64]]]) -> None:
    """Keep particles attached after a cut: divide the attachments of a body among its pieces.

    Args:
        body: body that was cut.
        pieces: each piece with the original of each of its vertices, (n,); the largest piece first.
    """
    context = context_of(body)
    frames = context.of(Frames)
    before = frames.attachments.pop(body, [])
    for attachment in before:
        found = [(each, np.flatnonzero(np.isin(origins, attachment.particles))) for each, origins in pieces]
        held = [(each, particles.astype(np.int32)) for each, particles in found if len(particles)]
        attachment.body, attachment.particles = held[0]
        frames.attachments.setdefault(attachment.body, []).append(attachment)
        for each, particles in held[1:]:
            other = Attachment(frames, each, particles, attachment.frame, two_way=attachment.two_way)
            other._break_force = attachment._break_force
            context.handles.enlist(other)
            frames.attachments.setdefault(each, []).append(other)
    if any(attachment.two_way for attachment in before):
        for each, _ in pieces:
            change(each, write_feeling, each.index, int(any(a.two_way for a in frames.holding(each))))


def attached_vertices(body: SoftBody) -> NDArray[np.int32]:
    """Return all attached vertices of a body, (k,)."""
    held = context_of(body).of(Frames).holding(body)
    return np.concatenate([np.zeros(0, np.int32), *(each.particles for each in held)])


def require_unattached(body: SoftBody, vertices: NDArray[np.int32]) -> None:
    """Check that none of `vertices` is attached to a frame. Raises: StateError with the first such vertex."""
    held = np.intersect1d(vertices, attached_vertices(body))
    if len(held):
        raise StateError(
            f"vertex {held[0]} of body {body.index} is attached to a frame: release the attachment first"
        )
