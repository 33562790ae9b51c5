"""Kinds of events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.failure import Failure
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.joints import Joint
from taichi_soft.control.motors import Motor

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Event:
    """An event in a fixed step."""

    step: int  # index of the step, from 0
    time: float  # [s], at the end of that step


@dataclass(frozen=True, eq=False)
class Released(Event):
    """`Body.set_level` with `release=True` released handles without vertices at the new level.

    It happens between steps: `step` is the coming step, and `time` its start.
    """

    body: SoftBody  # body whose level of detail changed
    handles: tuple[Attachment | Joint | Motor, ...]  # released handles, which are no longer alive


@dataclass(frozen=True, eq=False)
class ContactBegan(Event):
    """A body began to touch a collider (the floor is one) or another body.

    `a` is always a soft body. `isinstance(event.b, Collider)` is True for a collider.
    """

    a: SoftBody  # the body; of two bodies, the one with the smaller index
    b: Collider | SoftBody  # the collider, or the other body
    impulse: Floats  # (3,) that `a` gave `b` in that step [N s]; an impact can continue in the next step


@dataclass(frozen=True, eq=False)
class ContactEnded(Event):
    """A body and a collider, or two bodies, did not touch for 0.05 s, or one of them was removed."""

    a: SoftBody  # as in `ContactBegan`
    b: Collider | SoftBody  # as in `ContactBegan`
    impulse: Floats  # (3,) that `a` gave `b` in total [N s]; none is counted while bodies sleep
    duration: float  # [s] from the first step with an impulse to the end of the last, or of sleep


@dataclass(frozen=True, eq=False)
class StressExceeded(Event):
    """Tetrahedra exceeded the von Mises stress given to `Body.watch_stress`.

    They are sent only for bodies on which `watch_stress` was called.
    """

    body: SoftBody  # body of the tetrahedra
    tetrahedra: Ints  # (k,) that newly exceed the given stress, ascending
    stress: Floats  # (k,) von Mises stress [Pa], see `Body.tet_stress`


@dataclass(frozen=True, eq=False)
class TearCandidates(Event):
    """Tetrahedra exceeded the tensile stress given to `Body.watch_tearing`: tears start there (Rankine).

    They are sent only for bodies on which `watch_tearing` was called. They do not tear the body: see `Torn`.
    """

    body: SoftBody  # body of the tetrahedra
    tetrahedra: Ints  # (k,) that newly exceed the given stress, ascending
    stress: Floats  # (k,) largest principal stress [Pa]
    normals: Floats  # (k, 3) direction of that stress, which is the normal of the tear; either sign


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
        """Cause of the failure: `body.failure`, computed on first access; None once the body moves again."""
        return self.body.failure


@dataclass(frozen=True, eq=False)
class Torn(Event):
    """A body with `Tearing` tore after that step. `Body.cut` sends no event, because the caller knows."""

    body: SoftBody  # the largest piece; see `Body.topology_version`
    pieces: tuple[SoftBody, ...]  # new bodies, the largest first; () if the body stays connected


KINDS: tuple[type[Event], ...] = (
    Released,
    ContactBegan,
    ContactEnded,
    StressExceeded,
    TearCandidates,
    FellAsleep,
    Woke,
    Froze,
    Torn,
)
"""All kinds, in the order in which the events of one step are sent."""

CONTACT_KINDS = frozenset((ContactBegan, ContactEnded))
STRESS_KINDS = frozenset((StressExceeded, TearCandidates))
SLEEP_KINDS = frozenset((FellAsleep, Woke))
