"""Kinds of events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.failure import Failure
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.frames import Frame
from taichi_soft.control.joints import Joint
from taichi_soft.control.motors import Motor

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Event:
    """An event in a fixed step."""

    step: int  # index of the step, from 0
    time: float  # end of that step [s]


@dataclass(frozen=True, eq=False)
class Released(Event):
    """`Body.set_level` with `release=True` released handles that have no vertices at the new level.

    The release happens between steps: `step` is the next step, and `time` is the start of that step.
    """

    body: SoftBody  # body whose level of detail changed
    handles: tuple[Attachment | Joint | Motor, ...]  # the released handles, which are now invalid


@dataclass(frozen=True, eq=False)
class ContactBegan(Event):
    """A body began to touch another body or a collider, such as the floor.

    `a` is always a soft body. `isinstance(event.b, Collider)` is True for a collider.
    """

    a: SoftBody  # the body; if two bodies touch, the body with the smaller index
    b: Collider | SoftBody  # the collider, or the other body
    impulse: Floats  # (3,) impulse on `b` in that step [N s]; an impact can last several steps


@dataclass(frozen=True, eq=False)
class ContactEnded(Event):
    """A body and a collider, or two bodies, did not touch for 0.05 s, or one of them was removed."""

    a: SoftBody  # as in `ContactBegan`
    b: Collider | SoftBody  # as in `ContactBegan`
    impulse: Floats  # (3,) total impulse on `b` [N s], without impulses during sleep
    duration: float  # [s] from the first to the last impulse, including a rest after it


@dataclass(frozen=True, eq=False)
class StressExceeded(Event):
    """Tetrahedra exceeded the von Mises stress that was passed to `Body.watch_stress`.

    These events are sent only for bodies on which `watch_stress` was called.
    """

    body: SoftBody  # body of the tetrahedra
    tetrahedra: Ints  # (k,) tetrahedra that began to exceed the stress in this step, ascending
    stress: Floats  # (k,) von Mises stress [Pa], see `Body.tet_stress`


@dataclass(frozen=True, eq=False)
class TearCandidates(Event):
    """Tetrahedra exceeded the tensile stress that was passed to `Body.watch_tearing`.

    By Rankine's criterion, tears start in these tetrahedra. The events are sent only for bodies on which
    `watch_tearing` was called. An event does not tear the body: see `Torn`.
    """

    body: SoftBody  # body of the tetrahedra
    tetrahedra: Ints  # (k,) tetrahedra that began to exceed the stress in this step, ascending
    stress: Floats  # (k,) largest principal stress [Pa]
    normals: Floats  # (k, 3) direction of that stress, normal to the tear, with arbitrary sign


@dataclass(frozen=True, eq=False)
class FellAsleep(Event):
    """A body came to rest, and does not move until something wakes it."""

    body: SoftBody  # the sleeping body


@dataclass(frozen=True, eq=False)
class Woke(Event):
    """A sleeping body moves again."""

    body: SoftBody  # the body that woke


@dataclass(frozen=True, eq=False)
class Froze(Event):
    """The state of a body became non-finite, and was reset to the state before the step."""

    body: SoftBody  # the frozen body

    @property
    def failure(self) -> Failure | None:
        """Cause of the failure, see `Body.failure`; None once the body moves again.

        The cause is computed on first access.
        """
        return self.body.failure


@dataclass(frozen=True, eq=False)
class Entered(Event):
    """A body came into a sensor, see `World.add_sensor`."""

    body: SoftBody  # the body that now touches or encloses the sensor
    sensor: Collider  # the sensor


@dataclass(frozen=True, eq=False)
class Left(Event):
    """A body left a sensor, or one of the two was removed."""

    body: SoftBody  # the body, which can have been removed
    sensor: Collider  # the sensor, which can have been removed


@dataclass(frozen=True, eq=False)
class Torn(Event):
    """A body with `Tearing` tore after a step.

    `Body.cut` sends no event, because its caller knows of the cut.
    """

    body: SoftBody  # the largest piece; see `Body.topology_version`
    pieces: tuple[SoftBody, ...]  # new bodies, the largest first; () if the body stays connected


@dataclass(frozen=True, eq=False)
class Broke(Event):
    """A joint or an attachment broke after a step, because its mean force exceeded its `break_force`."""

    body: SoftBody  # the body whose particles were attached
    other: SoftBody | Frame  # the body or frame to which they were attached
    handle: Joint | Attachment  # the joint or attachment, which is now released
    impulse: Floats  # (3,) impulse of `other` on `body` in that step [N s]


KINDS: tuple[type[Event], ...] = (
    Released,
    ContactBegan,
    ContactEnded,
    StressExceeded,
    TearCandidates,
    FellAsleep,
    Woke,
    Froze,
    Entered,
    Left,
    Broke,
    Torn,
)
"""All kinds, in the order in which the events of one step are sent."""

CONTACT_KINDS = frozenset((ContactBegan, ContactEnded))
STRESS_KINDS = frozenset((StressExceeded, TearCandidates))
SLEEP_KINDS = frozenset((FellAsleep, Woke))
SENSOR_KINDS = frozenset((Entered, Left))
