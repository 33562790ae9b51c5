"""Particles that go with a frame, and what they pull it with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.control.access import change, named_particles, require_substeps, rows_of
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.kernels.pins import attach_particles, free_particles, read_reaction, write_feeling
from taichi_soft.core.checks import as_flag
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, recorded


class Attachment(Handle):
    """Particles of a body held by a frame. Made by `Body.attach`.

    Where the body is cut or tears, they are held on, and so are copies of them: `particles` has them all. If
    it falls apart, `body` is the largest piece that has some; what another has is held by an attachment of
    its own, in its `Body.attachments`.
    """

    def __init__(self, body: SoftBody, particles: NDArray[np.int32], frame: Frame, *, two_way: bool) -> None:
        """Made by `Body.attach`."""
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
        return self in self.body._attachments

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
        body._attachments.remove(self)
        if self.two_way and not any(each.two_way for each in body._attachments):
            change(body, write_feeling, body.index, 0)

    def _require_attached(self) -> None:
        if not self.is_attached:
            raise StateError(f"this attachment of body {self.body.index} was released: attach again")

    def _load(self) -> NDArray[np.float64]:
        self._require_attached()
        if not self.two_way:
            raise StateError("this attachment feels nothing: make it with two_way=True")
        impulses = np.empty(6)
        context = self.body._context
        rows = rows_of(self.body, self.particles)
        context.built.read(self.body.index, read_reaction, rows, self.frame.position, impulses)
        return impulses / max(context.clock.last_dt, 1e-30)


def attach(body: SoftBody, particles: ArrayLike, frame: Any, two_way: bool) -> Attachment:
    """As `Body.attach`."""
    body._require_alive()
    vertices = named_particles(body, particles)
    if not isinstance(frame, Frame) or frame._frames is not body._context.of(Frames):
        raise OptionError(f"frame must come from add_frame of the same world, got {frame!r}")
    frame._require_alive()
    feels = as_flag(two_way, "two_way")
    require_unattached(body, vertices)
    rows = rows_of(body, vertices)
    if feels:
        require_substeps(body._context, "forces on frames (two_way=True)")
    offsets = body.positions()[vertices].astype(np.float64) - frame.position
    local = (offsets @ frame.rotation).astype(np.float32)
    change(body, attach_particles, body.index, frame._number, int(feels), rows, local)
    body._context.of(Frames).has_work = True
    attachment = Attachment(body, vertices, frame, two_way=feels)
    body._handles.enlist(attachment)
    body._attachments.append(attachment)
    return attachment


def share_attachments(body: SoftBody, pieces: Sequence[tuple[SoftBody, NDArray[np.int64]]]) -> None:
    """Let go on what holds a body that was cut.

    Args:
        pieces: what it has become, the largest first, with the vertex of the body before that each vertex is,
            or is a copy of, (n,).
    """
    before, body._attachments = body._attachments, []
    for attachment in before:
        found = [(each, np.flatnonzero(np.isin(origins, attachment.particles))) for each, origins in pieces]
        held = [(each, particles.astype(np.int32)) for each, particles in found if len(particles)]
        attachment.body, attachment.particles = held[0]
        attachment.body._attachments.append(attachment)
        for each, particles in held[1:]:
            other = Attachment(each, particles, attachment.frame, two_way=attachment.two_way)
            body._handles.enlist(other)
            each._attachments.append(other)
    if any(attachment.two_way for attachment in before):
        for each, _ in pieces:
            change(each, write_feeling, each.index, int(any(held.two_way for held in each._attachments)))


def attached_vertices(body: SoftBody) -> NDArray[np.int32]:
    """All that frames hold, (k,)."""
    return np.concatenate([np.zeros(0, np.int32), *(each.particles for each in body._attachments)])


def require_unattached(body: SoftBody, vertices: NDArray[np.int32]) -> None:
    """Raises: StateError with the first of `vertices` that a frame holds."""
    held = np.intersect1d(vertices, attached_vertices(body))
    if len(held):
        raise StateError(
            f"vertex {held[0]} of body {body.index} is attached to a frame: release the attachment first"
        )
