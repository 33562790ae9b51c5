"""Choose the number of substeps of a fixed step."""

from __future__ import annotations

import logging
import math
import warnings
from typing import Any

import numpy as np

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.slots import Pools
from taichi_soft.bodies.soft_body import SoftBody, present_asset, record_of
from taichi_soft.bodies.stability import StableStep, stable_step
from taichi_soft.core.checks import as_count, as_step
from taichi_soft.core.errors import OptionError, SlowStepWarning, StateError, UnstableStepWarning

_log = logging.getLogger(__name__)

_PLAIN = {float, int, np.float64, type(None)}
"""Types of arguments that can be compared safely. For other types, `choose` does not reuse its last
result."""


SOFT_CONTACT_STEP = 1 / 240
"""Longest substep that implicit Euler uses by default in a world with contact between bodies [s]. The solve
ignores forces between bodies, so bodies in a pile look softer with longer substeps. For example, with twice
this substep, a pile of three blocks is compressed about three times as much; with four times this substep,
the pile falls."""


MANY_SUBSTEPS = 500
"""Largest number of substeps per step without a warning. With 500 substeps, a body of 1,000 tetrahedra takes
8 ms per step."""

FRAME = 1 / 60
"""Length of the step for which `World.build` checks the number of substeps [s]."""

TET_TIME = 15e-9
"""Approximate time per tetrahedron and substep on one thread [s]. `taichi-soft profile --baseline`
measures it."""


class Substeps:
    """Estimate and choose the number of substeps of one world."""

    def __init__(
        self, pools: Pools[SoftBody], *, has_stable_step: bool, soft_contact: bool | None, most: int | None
    ) -> None:
        """Start without estimates.

        Args:
            has_stable_step: True if bodies explode in substeps above a stable length.
            soft_contact, most: see `World(soft_contact=, max_substeps=)`.
        """
        self._pools = pools
        self.has_stable_step, self._soft_contact = has_stable_step, soft_contact
        # Estimates for bodies that were cut or changed material.
        self._estimates: dict[BodyDescription, StableStep] = {}
        self._asked: tuple[Any, ...] = ()
        self._chosen = (0.0, 0, 0.0)  # result of `choose` for the arguments `_asked`
        self._warned: set[float] = set()
        self._most, self._is_said = most, False

    @property
    def has_limit(self) -> bool:
        """True if the world refuses steps that need too many substeps."""
        return self._most is not None

    def stable_step(self, body: SoftBody) -> StableStep:
        """Implement `World.stable_step`."""
        described = record_of(body).description
        present = present_asset(body)
        if described is present.description:
            return present.stable_step
        if described not in self._estimates:
            self._estimates[described] = stable_step(described.mesh, described.material, described.model)
        return self._estimates[described]

    @property
    def rule(self) -> tuple[float, float]:
        """Factor f and divisor d [s] of the stable number of substeps, which is f dt / d rounded up.

        Raises: StateError for a world without bodies.
        """
        if not self._pools.slots:
            raise StateError("the world is empty: call add_body or reserve first")
        if not self.has_stable_step:
            has_contact = self._pools.can_touch if self._soft_contact is None else self._soft_contact
            return (0.999, SOFT_CONTACT_STEP) if has_contact else (1.0, math.inf)
        longest = min(each.stable_step.recommended for asset in self._pools.kinds for each in asset.levels)
        for body in self._pools.occupants:
            if record_of(body).description is not present_asset(body).description:
                longest = min(longest, self.stable_step(body).recommended)
        return 1.0, longest

    def stable_count(self, dt: float) -> int:
        """Return the number of substeps for `World.stable_substeps`."""
        share, longest = self.rule
        return max(1, math.ceil(share * as_step(dt) / longest))

    def review(self) -> None:
        """Warn before a world is built if a frame needs many substeps.

        Raises: OptionError if a frame needs more substeps than the world allows.
        """
        if self._pools.slots and self.has_stable_step:
            self._require_few(FRAME, self.stable_count(FRAME))

    def _require_few(self, dt: float, count: int) -> None:
        is_refused = self._most is not None and count > self._most
        if not is_refused and (count <= MANY_SUBSTEPS or self._is_said):
            return
        index, step = self._stiffest()
        cost = count * TET_TIME * sum(len(asset.mesh.tets) for asset in self._pools.assets)
        said = (
            f"a step of {dt:.4g} s takes {count:,} substeps, about {cost:.2g} s of one thread, because of "
            f"body {index}: {step.reason}"
        )
        if is_refused:
            raise OptionError(f"{said}; the world allows max_substeps={self._most:,}")
        self._is_said = True
        warnings.warn(said, SlowStepWarning, stacklevel=6)

    def _stiffest(self) -> tuple[int, StableStep]:
        """Return the slot of the body that needs the shortest substeps, and its stable step."""
        found = [(asset.stable_step, slot) for slot, asset in enumerate(self._pools.assets)]
        found += [(self.stable_step(body), body.index) for body in self._pools.occupants]
        step, slot = min(found, key=lambda each: each[0].limit)
        return slot, step

    def choose(self, dt: float, substeps: int | None) -> tuple[float, int, float]:
        """Return the length of a step [s], the number of substeps and their length [s], for `World.step`.

        Raises: OptionError for invalid arguments, or if the step needs more substeps than the world allows.
        """
        asked = (dt, substeps, type(dt), type(substeps))  # with types, because 4.0 == 4 and True == 1
        if not {type(dt), type(substeps)} <= _PLAIN or self._asked != asked:
            self._chosen = self._check(dt, substeps)
            self._asked = asked
        return self._chosen

    def _check(self, dt: float, substeps: int | None) -> tuple[float, int, float]:
        seconds = as_step(dt)
        count = as_count(self.stable_count(seconds) if substeps is None else substeps, "substeps")
        if substeps is None:
            if self.has_stable_step:
                self._require_few(seconds, count)
        elif self._most is not None and count > self._most:
            raise OptionError(f"substeps is {count:,}; the world allows max_substeps={self._most:,}")
        h = seconds / count
        _log.info("a step of %g s is made in %d substeps", seconds, count)
        if not self.has_stable_step:
            return seconds, count, h
        # Check only assets: callers pass `substeps` to avoid new estimates for cut or changed bodies.
        stiffest = min(self._pools.kinds, key=lambda asset: asset.stable_step.limit)
        limit = stiffest.stable_step.limit
        if h > limit and h not in self._warned:
            warnings.warn(
                f"substep {h * 1e3:.4g} ms is longer than the {limit * 1e3:.4g} ms that body "
                f"{self._pools.assets.index(stiffest)} can take ({stiffest.stable_step.stiffest}): it may "
                f"explode. Use substeps={self.stable_count(seconds)} or leave substeps out",
                UnstableStepWarning,
                stacklevel=5,  # the caller of World.step
            )
            self._warned.add(h)
        return seconds, count, h

    def forget(self) -> None:
        """Discard the last choice of substeps."""
        self._asked = ()

    def renew(self) -> None:
        """Discard estimates of materials that are no longer used."""
        used = {record_of(each).description for each in self._pools.occupants}
        self._estimates = {key: step for key, step in self._estimates.items() if key in used}
        if self._asked[1:2] == (None,):  # the chosen number belongs to the previous materials
            self.forget()
