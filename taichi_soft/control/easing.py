"""Change the material of a moving body gradually, so that a stiffer material adds no energy.

A sudden change to a stiffer material would increase the strain energy of a deformed body and accelerate it.
The constants therefore follow k(t) = k0 / (1 - (1 - sqrt(k0 / k1)) t / T)^2: the compliance decreases as a
parabola, and a loaded body moves to its new shape with constant deceleration. While k grows, vibrations are
damped in proportion to k^-`FADING`. The energy of a mode that is faster than the change then follows
k^(1/2 - FADING).
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.kernels.constant_rows import write_numbers
from taichi_soft.bodies.layout import BodyArrays
from taichi_soft.bodies.measures import elastic_energy
from taichi_soft.bodies.soft_body import Slice, SoftBody, present_asset, record_of
from taichi_soft.control.material_constants import write_constants, write_stiffness
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.serialisation import below

Floats = NDArray[np.float64]

SHORTEST, PERIODS = 0.5, 8.0
"""SHORTEST is the smallest duration of a change [s]. PERIODS is the smallest product of the duration and
the angular frequency of the slowest mode. A change has the smallest duration that satisfies both limits."""

HELD = 6.4
"""Frequency of a free beam, as a multiple of the frequency of the same beam held at one end. The value is
(4.730 / 1.875)^2, from the roots of the bending equation."""

FADING = 2.0
"""Exponent in the damping of vibrations during a change. Vibrations are damped in proportion to k^-FADING,
where k is the stiffness. The value 2 damps the slowest mode critically."""

TIMES_A_STEP = 8.0
"""Smallest number of times that vibrations are damped in each step of a change. See `kept_vibration`."""

LIFT = 1e-4
"""Height that limits the energy of an immediate change [m]. A change is immediate if it adds less energy
than lifting the body by this height."""

LARGEST_RATIO = 1e12
"""Largest ratio of new to initial stiffness. Elements with an initial stiffness of zero get this ratio."""


@dataclass(eq=False)
class Easing:
    """A running change of material."""

    constants: Floats  # current constants in the fields, in the layout of `_constants`
    ratio: float  # largest ratio of final to initial stiffness of all elements
    seconds: float  # duration of the change [s]
    passed: float = 0.0  # elapsed time [s]

    @property
    def plain(self) -> list[Any]:
        """Return the change as plain data for a snapshot."""
        content = base64.b64encode(self.constants.tobytes()).decode()
        return [self.ratio, self.seconds, self.passed, content]

    def stiffness(self, passed: float) -> float:
        """Return the ratio of current to initial stiffness of the element that changes most.

        Args: passed: time since the start of the change [s].
        """
        part = min(passed / self.seconds, 1.0)
        compliance = 1.0 - (1.0 - 1.0 / math.sqrt(self.ratio)) * part
        return 1.0 / (compliance * compliance)


class Easings(Slice):
    """All running changes of material of one world."""

    name, prevents_cuts, prevents_levels = "easings", False, False

    def __init__(self, context: Any) -> None:
        """Start without running changes."""
        super().__init__(context)
        self.by_body: dict[SoftBody, Easing] = {}
        self._left: list[SoftBody] = []  # bodies whose change was running before a restore

    def begin(self, body: SoftBody, material: Any) -> None:
        """Start to change the material of a body."""
        record, built = record_of(body), self.context.built
        before, energy = record.present or self._arrays(body), elastic_energy(body)
        self.release_body(body)
        built.change(body.index, write_constants, body, replace(record.description, material=material))
        ratio = _growth(before, self._arrays(body))
        added = elastic_energy(body) - energy
        if ratio > 1.0 and added > LIFT * GRAVITY_EARTH * float(body.masses.sum()):
            self._go_on(body, Easing(_constants(before), ratio, self._duration(body, before)))

    def _go_on(self, body: SoftBody, easing: Easing) -> None:
        """Register a running change."""
        arrays = _with(self._arrays(body), easing.constants)
        self.by_body[body], record_of(body).present = easing, arrays
        write_stiffness(self.context.built.state, self._place(body), arrays)

    def _duration(self, body: SoftBody, before: BodyArrays) -> float:
        """Return the duration [s] of a change of a body from the arrays `before` to its current arrays."""
        asset = present_asset(body)
        softer = _mean_modulus(asset.arrays) / max(_mean_modulus(before), 1e-30)
        heavier = float(before.mass.mean() / asset.arrays.mass.mean())
        if asset.guessed_frequency == 0.0:
            return SHORTEST
        slower = HELD if len(body.pinned) or body.is_held else 1.0
        return max(SHORTEST, PERIODS * slower * math.sqrt(softer * heavier) / asset.guessed_frequency)

    def advance(self, seconds: float) -> None:
        """Advance all changes to the end of the next step, which lasts `seconds` [s]."""
        for body, easing in list(self.by_body.items()):
            before = easing.stiffness(easing.passed)
            easing.passed += seconds
            now, arrays = easing.stiffness(easing.passed), self._arrays(body)
            rate = 0.0
            if easing.passed < easing.seconds:
                part = (now - before) / (easing.ratio - before)
                easing.constants = easing.constants + part * (_constants(arrays) - easing.constants)
                arrays = record_of(body).present = _with(arrays, easing.constants)
                rate = FADING * (now - before) / (now * seconds)
            else:
                self.release_body(body)
            self.context.built.change(body.index, _write, body, self._place(body), arrays, rate, seconds)

    def finish(self, body: SoftBody) -> None:
        """Finish a running change of a body's material immediately."""
        if body in self.by_body:
            self.release_body(body)
            arrays, place = self._arrays(body), self._place(body)
            self.context.built.change(body.index, _write, body, place, arrays, 0.0, 1.0)

    def _arrays(self, body: SoftBody) -> BodyArrays:
        return self.context.layout.bodies[body.index]

    def _place(self, body: SoftBody) -> Any:
        return self.context.layout.ranges[body.index]

    def release_body(self, body: SoftBody) -> None:
        """See `Slice.release_body`."""
        self.by_body.pop(body, None)
        record_of(body).present = None

    def share(self, body: SoftBody, order: Any, pieces: Sequence[tuple[SoftBody, NDArray[np.int64]]]) -> None:
        """Continue a change in the pieces of a cut body.

        Args:
            body: body that was cut.
            order: order of the body's tetrahedra in the fields before the cut.
            pieces: each piece with the original of each of its tetrahedra, (m,).
        """
        easing = self.by_body.get(body)
        self.release_body(body)
        if easing is None or self._arrays(body).bonds is not None:
            return
        rows = easing.constants.reshape(len(order), -1)[np.argsort(order)]
        for piece, tets in pieces:
            self._go_on(piece, replace(easing, constants=rows[tets][self._arrays(piece).tet_order].ravel()))

    def warm_up(self, body: SoftBody, other: SoftBody | None, step: Callable[[], None]) -> None:
        """Compile the kernels of a change, by calling them."""
        _ = present_asset(body).guessed_frequency
        _write(self.context.built.state, body, self._place(body), self._arrays(body), 0.0, 1.0)

    def entries(self) -> list[list[Any]]:
        """List each change's body, stiffness ratio, duration, elapsed time and current constants."""
        eased = sorted(self.by_body.items(), key=lambda item: item[0].index)
        return [[body.index, *easing.plain] for body, easing in eased]

    def serials(self, entries: list[list[Any]]) -> list[int]:
        """Return an empty list, because changes have no handles."""
        return []

    def read(
        self, entries: list[list[Any]], vertex_counts: Sequence[int], earlier: dict[str, Any]
    ) -> list[tuple[int, Easing]]:
        """See `Slice.read`. Raises: ValueError for a missing body or values that are not finite."""
        found = []
        for slot, ratio, seconds, passed, content in entries:
            if not vertex_counts[below(slot, len(vertex_counts))]:
                raise ValueError("a change of material has no body")
            constants = np.frombuffer(base64.b64decode(content, validate=True), dtype=np.float64)
            easing = Easing(constants, float(ratio), float(seconds), float(passed))
            if not (1.0 < easing.ratio <= LARGEST_RATIO and 0.0 <= easing.passed < easing.seconds < math.inf):
                raise ValueError("a change of material is out of range")
            if not np.abs(constants).max(initial=0.0) < 1e30:
                raise ValueError("a material is not finite")
            found.append((int(slot), easing))
        return found

    def clear(self) -> None:
        """See `Slice.clear`."""
        self._left = list(self.by_body)
        for body in self._left:
            self.release_body(body)

    def restore(self, read: Any) -> None:
        """Continue the changes from `read`."""
        slots, state = self.context.slots.slots, self.context.built.state
        for body in self._left:
            if slots[body.index] is body:
                write_stiffness(state, self._place(body), self._arrays(body))
        for slot, easing in read:
            body = slots[slot]
            if body is not None and len(easing.constants) == len(_constants(self._arrays(body))):
                self._go_on(body, easing)


def _write(state: Any, body: SoftBody, place: Any, arrays: BodyArrays, rate: float, seconds: float) -> None:
    """Write the constants of a body, and the damping `rate` of its vibrations in the next step [1/s].

    This function has the signature of a kernel, for `Built.change`.
    """
    write_stiffness(state, place, arrays)
    own, interval = present_asset(body).vibration_row(record_of(body).description)
    if rate > 0.0:
        interval = min(interval, seconds / TIMES_A_STEP)
    write_numbers(state.body_fading, body.index, np.array([own + rate], dtype=np.float32))
    write_numbers(state.body_fading_interval, body.index, np.array([interval], dtype=np.float32))


def _parts(arrays: BodyArrays) -> list[Floats]:
    """Return the constants that change with time: elastic ones, or those of edges, a shell or a rod."""
    if arrays.rods is not None:
        return [arrays.rods.edges[:, 1:2], arrays.rods.joints[:, :2]]
    if arrays.shells is not None:
        return [arrays.shells.lame, arrays.shells.bending]
    parts = [arrays.lame]
    if arrays.stiffness.any():
        parts.append(arrays.stiffness)
    if arrays.bonds is not None:
        parts += [arrays.bonds.constants, arrays.bonds.weights]
        if arrays.bonds.expansion_modulus is not None:
            parts.append(arrays.bonds.expansion_modulus)
    return parts


def _constants(arrays: BodyArrays) -> Floats:
    """Concatenate the arrays of `_parts`. For laws on tetrahedra, the result is ordered by tetrahedron."""
    parts = _parts(arrays)
    if arrays.bonds is None:
        return np.concatenate(parts, axis=1).ravel()
    return np.concatenate([part.ravel() for part in parts])


def _with(arrays: BodyArrays, constants: Floats) -> BodyArrays:
    """Return `arrays` with their constants replaced by `constants`, in the layout of `_constants`."""
    parts = _parts(arrays)
    if arrays.rods is not None:
        edges, joints = arrays.rods.edges.copy(), arrays.rods.joints.copy()
        edges[:, 1], joints[:, :2] = constants.reshape(-1, 3)[:, 0], constants.reshape(-1, 3)[:, 1:]
        return replace(arrays, rods=replace(arrays.rods, edges=edges, joints=joints))
    if arrays.shells is not None:
        lame, bending = np.split(constants.reshape(len(parts[0]), -1), [2], axis=1)
        return replace(arrays, shells=replace(arrays.shells, lame=lame, bending=bending))
    if arrays.bonds is None:
        rows = constants.reshape(len(arrays.lame), -1)
        stiffness = rows[:, 2:] if len(parts) > 1 else arrays.stiffness
        return replace(arrays, lame=rows[:, :2], stiffness=stiffness)
    ends = np.cumsum([part.size for part in parts])[:-1]
    shaped = [row.reshape(part.shape) for row, part in zip(np.split(constants, ends), parts, strict=True)]
    modulus = shaped.pop() if arrays.bonds.expansion_modulus is not None else None
    bonds = replace(arrays.bonds, constants=shaped[-2], weights=shaped[-1], expansion_modulus=modulus)
    return replace(arrays, lame=shaped[0], bonds=bonds)


def _moduli(arrays: BodyArrays) -> Floats:
    """Return the moduli by which the stiffness of elements is compared, (m, k).

    The moduli of an element are its bulk and shear moduli (up to factors), the stiffness along an edge, the
    diagonal of an anisotropic stiffness, the stiffness of a shell in bending and in shear, or the stiffness
    of a rod in bending, in torsion and along its edges.
    """
    if arrays.rods is not None:
        return np.concatenate([arrays.rods.joints[:, :2], arrays.rods.edges[:, 1:2]], axis=1)
    if arrays.shells is not None:
        bending = (arrays.shells.bending**2).sum(axis=1, keepdims=True)
        return np.concatenate([bending, arrays.shells.lame[:, 1:]], axis=1)
    if not len(arrays.lame):
        assert arrays.bonds is not None
        return arrays.bonds.constants[:, 1:2]
    if arrays.stiffness.any():
        return arrays.stiffness[:, [0, 6, 11, 15, 18, 20]]
    first, shear = arrays.lame.T
    return np.stack([3.0 * first + 2.0 * shear, shear], axis=1)


def _mean_modulus(arrays: BodyArrays) -> float:
    return float(_moduli(arrays)[:, -1].mean())


def _growth(before: BodyArrays, after: BodyArrays) -> float:
    """Return the largest ratio of new to old stiffness of all elements, at least 1."""
    old, new = _moduli(before), _moduli(after)
    grown = new > old
    return float(np.minimum(new[grown] / np.maximum(old[grown], 1e-300), LARGEST_RATIO).max(initial=1.0))
