"""Particles of one body held by another, and what passes between the two."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.control.access import change, named_particles, rows_of
from taichi_soft.control.joint_fields import JOINT_ROWS, MOST_JOINTS
from taichi_soft.control.kernels.joints import end_joint, read_joint_impulse, write_joint
from taichi_soft.control.patches import wave_speed
from taichi_soft.control.places import Places, places_at, places_on
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.core.handles import Handle, recorded
from taichi_soft.solver.kernels.islands import list_joined_islands

if TYPE_CHECKING:
    from taichi_soft.world.body import Body
    from taichi_soft.world.world import World

DRAW = 0.25
"""Speed at which a gap closes at most, over that of waves in the body times the root of the part of its mass
that is held: pulled so, a body follows before its elements stretch by much more than a quarter."""


class Joint(Handle):
    """Particles of a body held by another body. Made by `Body.attach_to`."""

    def __init__(self, body: Body, other: Body, number: int, particles: NDArray[np.int32]) -> None:
        """Made by `Body.attach_to`."""
        self.body = body
        self.other = other
        self.particles = particles
        self._number = number

    def __repr__(self) -> str:
        state = "" if self.is_attached else ", released"
        count = len(self.particles)
        return f"Joint(body {self.body.index} to {self.other.index}, {count} particles{state})"

    @property
    def is_attached(self) -> bool:
        """False once released, and once one of the two bodies was removed."""
        return self.body.is_alive and self.body._world._joints.get(self._number) is self

    @property
    def force(self) -> NDArray[np.float64]:
        """With what `other` pulls `body`, mean over the last step, (3,) [N]; 0 for one in which either froze.

        Raises: StateError once released.
        """
        self._require_attached()
        world = self.body._world
        impulse = np.empty(3, dtype=np.float32)
        read_joint_impulse(world._built.state, self._number, impulse)
        return impulse.astype(np.float64) / max(world.last_dt, 1e-30)

    @recorded
    def release(self) -> None:
        """Let the particles go, with the velocity that they have.

        Raises: StateError if it was done before.
        """
        self._require_attached()
        world = self.body._world
        world._built.wake(self.other.index)
        change(self.body, end_joint, self._number)
        del world._joints[self._number]
        renew_islands(world)

    def _require_attached(self) -> None:
        if not self.is_attached:
            raise StateError(
                f"this joint of bodies {self.body.index} and {self.other.index} was released: attach again"
            )


def attach_to(body: Body, other: Any, particles: ArrayLike, onto: ArrayLike | None) -> Joint:
    """As `Body.attach_to`."""
    world = body._world
    if not isinstance(other, type(body)) or other is body or other._world_ref() is not world:
        raise OptionError(f"other must be another body of the same world, got {other!r}")
    other._require_alive()
    vertices, places = _find_places(body, other, particles, onto)
    if world.settings.is_implicit:
        raise StateError("implicit_euler has no joints: make the world with integrator='leapfrog'")
    if not world._built.program.has_contact:
        raise StateError(
            "joints need bodies that are stepped together: make the world with soft_contact=True, or with "
            "collider_room=1 where bodies shall not touch each other"
        )
    free = next((number for number in range(MOST_JOINTS) if number not in world._joints), None)
    if free is None:
        raise StateError(f"all {MOST_JOINTS} joints of this world are in use: release one first")
    used = rows_in_use(world)
    if used + len(vertices) > JOINT_ROWS:
        raise StateError(
            f"the joints of a world hold at most {JOINT_ROWS} particles: {used} are held, and "
            f"{len(vertices)} more were asked for. Release a joint, or name fewer"
        )
    world._built.wake(other.index)
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
    joint = world._joints[free] = Joint(body, other, free, vertices)
    body._handles.enlist(joint)
    renew_islands(world)
    return joint


def _find_places(
    body: Body, other: Body, particles: ArrayLike, onto: ArrayLike | None
) -> tuple[NDArray[np.int32], Places]:
    """Vertices of `body` and where `other` holds them. Raises: OptionError."""
    vertices = named_particles(body, particles)
    if onto is None:
        points = body.positions()[vertices].astype(np.float64)
        return vertices, places_at(other, points, [f"vertex {v} of body {body.index}" for v in vertices])
    named_particles(other, onto, "onto")
    given, partners = np.asarray(particles), np.asarray(onto)
    if len(vertices) != len(given):
        raise OptionError(f"particles names {len(given) - len(vertices)} vertices twice: name each once")
    if len(partners) != len(given):
        raise OptionError(
            f"onto names {len(partners)} vertices for {len(given)} particles: name one for each"
        )
    return vertices, places_on(other, partners[np.argsort(given, kind="stable")].astype(np.int32))


def _draw_speed(body: Body, other: Body, vertices: NDArray[np.int32], places: Places) -> float:
    """[m/s] at which a gap between the two may close."""
    holders = np.unique(places.vertices[places.weights != 0.0])
    slowest = min(
        wave_speed(each._description) * np.sqrt(each.masses[held].sum() / each.masses.sum())
        for each, held in ((body, vertices), (other, holders))
    )
    return DRAW * float(slowest)


def rows_in_use(world: World) -> int:
    """Particles that all joints of a world hold together."""
    return sum(len(joint.particles) for joint in world._joints.values())


def renew_islands(world: World) -> None:
    """Let bodies that are joined be stepped together, where no step finds out by itself."""
    program = world._built.program
    if program.has_contact and not program.has_soft_contact:
        list_joined_islands(world._built.state, world.slot_count)
