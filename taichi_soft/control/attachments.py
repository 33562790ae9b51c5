"""Particles that go with a frame, and what they pull it with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import Slice, SoftBody, context_of
from taichi_soft.control.change import change, named_particles, require_substeps, rows_of
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.kernels.pins import attach_particles, free_particles, read_reaction, write_feeling
from taichi_soft.core.checks import as_flag
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import Handle, recorded, serial_of
from taichi_soft.core.math.rotations import turned
from taichi_soft.core.serialisation import below, indices_below
from taichi_soft.core.types import Schedule


class Attachment(Handle):
    """Particles of a body held by a frame. Made by `Body.attach`.

    Where the body is cut or tears, they are held on, and so are copies of them: `particles` has them all. If
    it falls apart, `body` is the largest piece that has some; what another has is held by an attachment of
    its own, in its `Body.attachments`. Where the level of detail changes, the nearest vertices are held on.
    """

    def __init__(
        self, frames: Frames, body: SoftBody, particles: NDArray[np.int32], frame: Frame, *, two_way: bool
    ) -> None:
        """Made by `Body.attach`."""
        self._frames = frames
        self.body = body
        self.particles = particles
        self.frame = frame
        self.two_way = two_way

    def __repr__(self) -> str:
        state = "" if self.is_attached else ", released"
        return f"Attachment(body {self.body.index}, {len(self.particles)} particles, {self.frame!r}{state})"

    @property
    def is_attached(self) -> bool:
        """False once released."""
        return self in self._frames.holding(self.body)

    @property
    def force(self) -> NDArray[np.float64]:
        """What the body pulled the frame with, mean over the last step, (3,) [N].

        The weight of what is held by it and what it takes to accelerate it included. A frozen body pulls at
        nothing: 0, or what others do to the particles that are held.
        Raises: StateError once released, or made without `two_way`.
        """
        return self._load()[:3]

    @property
    def torque(self) -> NDArray[np.float64]:
        """The same force's torque about the frame's origin, (3,) [N m]. Raises: as `force`."""
        return self._load()[3:]

    @recorded
    def release(self) -> None:
        """Let the particles go, with the velocity that they had. Raises: StateError if it was done before."""
        self._require_attached()
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

    def _load(self) -> NDArray[np.float64]:
        self._require_attached()
        if not self.two_way:
            raise StateError("this attachment feels nothing: make it with two_way=True")
        impulses = np.empty(6)
        context = context_of(self.body)
        rows = rows_of(self.body, self.particles)
        context.built.read(self.body.index, read_reaction, rows, self.frame.position, impulses)
        return impulses / max(context.clock.last_dt, 1e-30)


class Attachments(Slice):
    """All attachments of one world; its `Frames` know them by body."""

    name = "attachments"
    prevents_cuts = False  # `share_attachments` lets pieces hang on
    prevents_levels = False  # see `levels.reattaching`

    @property
    def _frames(self) -> Frames:
        return self.context.of(Frames)

    def holds(self, body: SoftBody) -> bool:
        """Whether it is attached to a frame."""
        return bool(self._frames.holding(body))

    def release_body(self, body: SoftBody) -> None:
        """Release all that hold a body."""
        for attachment in list(self._frames.holding(body)):
            attachment.release()

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Attach a vertex that is free to a frame, and ask what it pulls with."""
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
        """Numbers of handle, body and frame, whether it feels a load, and the particles that it holds."""
        frames, bodies = self._frames, sorted(self._frames.attachments, key=lambda body: body.index)
        return [
            [serial_of(a), body.index, frames.number_of(a.frame), a.two_way, a.particles.tolist()]
            for body in bodies
            for a in frames.attachments[body]
        ]

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, int, int, bool, NDArray[np.int32]]]:
        """Rows of `entries`. Raises: ValueError for what holds nobody, or hangs from no frame."""
        rows = {row for row, (serial, _, _) in enumerate(earlier[Frames.name]) if serial != 0}
        found = []
        for serial, slot, number, two_way, particles in entries:
            count = vertex_counts[below(slot, len(vertex_counts))]
            if not count or number not in rows:
                raise ValueError("an attachment holds no body, or hangs from no frame")
            found.append(
                (int(serial), int(slot), int(number), bool(two_way), indices_below(particles, count))
            )
        return found

    def restore(self, read: Any) -> None:
        """Let there be the attachments that were `read`, and no other."""
        context, frames = self.context, self._frames
        frames.attachments.clear()
        for serial, slot, number, two_way, particles in read:
            body, frame = context.slots.slots[slot], frames.rows[number]
            assert body is not None
            assert frame is not None
            held = context.handles.find(serial, Attachment) or Attachment(
                frames, body, particles, frame, two_way=two_way
            )
            held.body, held.frame, held.particles, held.two_way = body, frame, particles, two_way
            context.handles.enlist(held, serial)
            frames.attachments.setdefault(body, []).append(held)


def attach(body: SoftBody, particles: ArrayLike, frame: Any, two_way: bool) -> Attachment:
    """As `Body.attach`."""
    context = context_of(body)
    frames = context.of(Frames)
    vertices = named_particles(body, particles)
    number = frames.number_of(frame)
    feels = as_flag(two_way, "two_way")
    require_unattached(body, vertices)
    rows = rows_of(body, vertices)
    if feels:
        require_substeps(context, "forces on frames (two_way=True)")
    offsets = body.positions()[vertices].astype(np.float64) - frame.position
    local = turned(offsets, frame.rotation.T.astype(np.float64)).astype(np.float32)
    change(body, attach_particles, body.index, number, int(feels), rows, local)
    frames.has_work = True
    attachment = Attachment(frames, body, vertices, frame, two_way=feels)
    context.handles.enlist(attachment)
    frames.attachments.setdefault(body, []).append(attachment)
    return attachment


def share_attachments(body: SoftBody, pieces: Sequence[tuple[SoftBody, NDArray[np.int64]]]) -> None:
    """Let go on what holds a body that was cut.

    Args:
        pieces: what it has become, the largest first, with the vertex of the body before that each vertex is,
            or is a copy of, (n,).
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
            context.handles.enlist(other)
            frames.attachments.setdefault(each, []).append(other)
    if any(attachment.two_way for attachment in before):
        for each, _ in pieces:
            change(each, write_feeling, each.index, int(any(a.two_way for a in frames.holding(each))))


def attached_vertices(body: SoftBody) -> NDArray[np.int32]:
    """All that frames hold, (k,)."""
    held = context_of(body).of(Frames).holding(body)
    return np.concatenate([np.zeros(0, np.int32), *(each.particles for each in held)])


def require_unattached(body: SoftBody, vertices: NDArray[np.int32]) -> None:
    """Raises: StateError with the first of `vertices` that a frame holds."""
    held = np.intersect1d(vertices, attached_vertices(body))
    if len(held):
        raise StateError(
            f"vertex {held[0]} of body {body.index} is attached to a frame: release the attachment first"
        )
