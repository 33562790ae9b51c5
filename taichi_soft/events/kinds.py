"""What can happen in a step, by kind."""

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
    """Something that happened in a fixed step."""

    step: int  # of the world, counted from 0
    time: float  # [s], at the end of that step


@dataclass(frozen=True, eq=False)
class Released(Event):
    """`Body.set_level` with `release=True` has released what has no place at the new level.

    It happens before a step: `step` is the coming one, and `time` is that at its beginning.
    """

    body: SoftBody  # whose level of detail changes
    handles: tuple[Attachment | Joint | Motor, ...]  # which are dead now


@dataclass(frozen=True, eq=False)
class ContactBegan(Event):
    """A body has begun to touch a collider (the floor is one) or another body.

    `a` is always a soft body. `isinstance(event.b, Collider)` tells what it touches.
    """

    a: SoftBody  # the body; of two bodies the one with the smaller index
    b: Collider | SoftBody  # the collider, or the other body
    impulse: Floats  # (3,) that `a` gave `b` in that step [N s]; a hit may go on in the next one


@dataclass(frozen=True, eq=False)
class ContactEnded(Event):
    """A body and a collider, or two bodies, have not touched for 0.05 s, or one of them was removed."""

    a: SoftBody  # as in `ContactBegan`
    b: Collider | SoftBody  # as in `ContactBegan`
    impulse: Floats  # (3,) that `a` gave `b` from beginning to end [N s]; what sleeps gives none
    duration: float  # [s] from the start of the first step with one to the end of the last, or of sleep


@dataclass(frozen=True, eq=False)
class StressExceeded(Event):
    """Tetrahedra have come over the von Mises stress that `Body.watch_stress` was given.

    Of a body that `watch_stress` was not called for nothing is told.
    """

    body: SoftBody  # that the tetrahedra belong to
    tetrahedra: Ints  # (k,) those that were not over it before, ascending
    stress: Floats  # (k,) von Mises, as `Body.tet_stress` [Pa]


@dataclass(frozen=True, eq=False)
class TearCandidates(Event):
    """Tetrahedra are pulled harder than `Body.watch_tearing` allows: where a tear would begin (Rankine).

    Of a body that `watch_tearing` was not called for nothing is told. Nothing tears by it: see `Torn`.
    """

    body: SoftBody  # that the tetrahedra belong to
    tetrahedra: Ints  # (k,) those that were not before, ascending
    stress: Floats  # (k,) largest principal stress [Pa]
    normals: Floats  # (k, 3) its direction, which is the normal of the tear; either sign


@dataclass(frozen=True, eq=False)
class FellAsleep(Event):
    """A body has come to rest, and is not moved until something wakes it."""

    body: SoftBody  # that sleeps


@dataclass(frozen=True, eq=False)
class Woke(Event):
    """A sleeping body moves again."""

    body: SoftBody  # that moves again


@dataclass(frozen=True, eq=False)
class Froze(Event):
    """A body went non-finite and was put back to where it was before the step."""

    body: SoftBody  # that is frozen

    @property
    def failure(self) -> Failure | None:
        """What broke first: `body.failure`, which is found out when first asked, and None once it moves."""
        return self.body.failure


@dataclass(frozen=True, eq=False)
class Torn(Event):
    """A body with `Tearing` has torn after that step; whoever calls `Body.cut` knows without being told."""

    body: SoftBody  # what is left of it; see `Body.topology_version`
    pieces: tuple[SoftBody, ...]  # new bodies that fell off, the largest first; () if it holds together


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
"""In the order in which the events of one step come."""

CONTACT_KINDS = frozenset((ContactBegan, ContactEnded))
STRESS_KINDS = frozenset((StressExceeded, TearCandidates))
SLEEP_KINDS = frozenset((FellAsleep, Woke))
