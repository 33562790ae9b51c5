"""Into how many substeps a fixed step is cut."""

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
"""Types whose values can be compared with those of the last step."""


SOFT_CONTACT_STEP = 1 / 240
"""Substep of implicit Euler [s], at most, where bodies touch each other and nothing else is asked for. What
passes between them the solve does not know of, so they look softer the longer it is: in a pile of three,
blocks of half a metre (1 MPa) are lower than by leapfrog by 3 to 9 mm so, and by 9 to 27 mm at 120 Hz; at
60 Hz the pile falls."""


MANY_SUBSTEPS = 500
"""Of a step: a world that needs more says so. A body of 1,000 tetrahedra then takes 8 ms a step."""

FRAME = 1 / 60
"""Step [s] for which a world is judged when it is built."""

TET_TIME = 15e-9
"""Of a tetrahedron and substep on one thread [s], about (docs: `taichi-soft profile --baseline`)."""


class Substeps:
    """How long the substeps of one world can be, and how long they are."""

    def __init__(
        self, pools: Pools[SoftBody], *, has_stable_step: bool, soft_contact: bool | None, most: int | None
    ) -> None:
        """`has_stable_step`: longer substeps explode. `soft_contact`, `most`: as arguments of `World`."""
        self._pools = pools
        self.has_stable_step, self._soft_contact = has_stable_step, soft_contact
        self._estimates: dict[BodyDescription, StableStep] = {}  # of bodies with another material
        self._asked: tuple[Any, ...] = ()
        self._chosen = (0.0, 0, 0.0)  # for what was asked last
        self._warned: set[float] = set()
        self._most, self._is_said = most, False

    @property
    def has_limit(self) -> bool:
        """True if a step that needs too many is refused."""
        return self._most is not None

    def stable_step(self, body: SoftBody) -> StableStep:
        """As `World.stable_step`."""
        described = record_of(body).description
        present = present_asset(body)
        if described is present.description:
            return present.stable_step
        if described not in self._estimates:
            self._estimates[described] = stable_step(described.mesh, described.material, described.model)
        return self._estimates[described]

    @property
    def rule(self) -> tuple[float, float]:
        """Of a step, as many substeps are stable as its length times the first, over the second [s], is
        rounded up to.

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
        """As `World.stable_substeps`."""
        share, longest = self.rule
        return max(1, math.ceil(share * as_step(dt) / longest))

    def review(self) -> None:
        """Before a world is built: say how many substeps a frame will take, where these are many.

        Raises: OptionError where they are more than the world may take.
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
            raise OptionError(f"{said}; the world takes max_substeps={self._most:,}")
        self._is_said = True
        warnings.warn(said, SlowStepWarning, stacklevel=6)

    def _stiffest(self) -> tuple[int, StableStep]:
        """The slot that needs the shortest substeps, and these."""
        found = [(asset.stable_step, slot) for slot, asset in enumerate(self._pools.assets)]
        found += [(self.stable_step(body), body.index) for body in self._pools.occupants]
        step, slot = min(found, key=lambda each: each[0].limit)
        return slot, step

    def choose(self, dt: float, substeps: int | None) -> tuple[float, int, float]:
        """Length of a step [s], number of its substeps and their length [s], as `World.step` takes them.

        Raises: OptionError.
        """
        asked = (dt, substeps, type(dt), type(substeps))  # 4.0 == 4 and True == 1, but they are refused
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
            raise OptionError(f"substeps is {count:,}; the world takes max_substeps={self._most:,}")
        h = seconds / count
        _log.info("a step of %g s is made in %d substeps", seconds, count)
        if not self.has_stable_step:
            return seconds, count, h
        # Of bodies that were cut or are of something else nothing is estimated here: the caller knows better.
        stiffest = min(self._pools.kinds, key=lambda asset: asset.stable_step.limit)
        limit = stiffest.stable_step.limit
        if h > limit and h not in self._warned:
            warnings.warn(
                f"substep {h * 1e3:.4g} ms is longer than the {limit * 1e3:.4g} ms that body "
                f"{self._pools.assets.index(stiffest)} can take ({stiffest.stable_step.stiffest}): it may "
                f"explode. Use substeps={self.stable_count(seconds)} or leave substeps out",
                UnstableStepWarning,
                stacklevel=5,  # who called World.step
            )
            self._warned.add(h)
        return seconds, count, h

    def forget(self) -> None:
        """Choose anew, whatever is asked."""
        self._asked = ()

    def renew(self) -> None:
        """Take note that a body is made of something else."""
        used = {record_of(each).description for each in self._pools.occupants}
        self._estimates = {key: step for key, step in self._estimates.items() if key in used}
        if self._asked[1:2] == (None,):  # whose number was chosen for what was there before
            self.forget()
