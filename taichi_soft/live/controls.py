"""What a visitor may change while a world runs: names, ranges, and what to do with a value."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_soft import Body, Material, SoftBodyAsset, World
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.live.choices import palette_of
from taichi_soft.solver.substeps import SOFT_CONTACT_STEP
from taichi_soft.world.world import context_of_world


@dataclass(frozen=True)
class Slider:
    """A number.

    Args:
        name: by which page and world call it.
        label, unit: what a visitor reads.
        low, high: the range.
        is_log: whether equal ways of the hand are equal ratios.
        is_whole: whether only whole numbers count.
        told: what a change costs, or where it gets unstable.
    """

    name: str
    label: str
    unit: str
    low: float
    high: float
    told: str
    is_log: bool = False
    is_whole: bool = False


SLIDERS = {
    each.name: each
    for each in (
        Slider("young", "Young's modulus", "Pa", 1e3, 1e8, "stiffer takes more substeps", is_log=True),
        Slider("poisson", "Poisson's ratio", "", -0.9, 0.49, "near 0.5 takes many more substeps"),
        Slider("damping", "Damping ratio", "", 0.0, 1.0, "of the slowest vibration; costs nothing"),
        Slider("gravity", "Gravity", "m/s²", 0.0, 30.0, "costs nothing"),
        Slider("friction", "Friction", "", 0.0, 2.0, "of floor, colliders and bodies; costs nothing"),
        Slider("substeps", "Substeps", "", 1, 400, "too few are unstable", is_log=True, is_whole=True),
        Slider("speed", "Slow motion", "x", 0.02, 1.0, "of real time; costs nothing", is_log=True),
    )
}
"""By name."""


def checked_value(name: Any, value: Any) -> float:
    """The value of a slider. Raises: OptionError for a slider that is none, and a value out of its range."""
    if not isinstance(name, str) or name not in SLIDERS:
        raise OptionError(f"there is no slider {name!r}")
    slider = SLIDERS[name]
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not slider.low <= value <= slider.high:  # as a NaN is
        raise OptionError(f"{slider.label} goes from {slider.low:g} to {slider.high:g}, got {value!r}")
    return float(round(value)) if slider.is_whole else float(value)


class Controls:
    """The values that a world has, and those that a visitor gave it."""

    def __init__(self, world: World, dt: float, substeps: int | None) -> None:
        self.world, self.dt = world, dt
        self.given: dict[str, float] = {}
        self._own_substeps = substeps
        self._own = {body.index: body.material for body in world.bodies}
        self._first = next((each for each in self._own.values() if isinstance(each, Material)), None)
        self._first_stable = world.stable_substeps(dt)
        assets = {id(body.asset): body.asset for body in world.bodies}
        self._assets = [*assets.values(), *palette_of(world).values()]
        self._down = np.asarray(world.settings.gravity, dtype=np.float64)
        length = float(np.linalg.norm(self._down))
        self._down = self._down / length if length else np.array([0.0, 0.0, -1.0])

    @property
    def stable_substeps(self) -> int:
        """How many a step needs with these materials, predicted from the speed of waves in each asset.

        An estimate of every body anew would stop the world for a moment at each move of a slider.
        """
        is_implicit = self.world.settings.is_implicit
        if self._first is None or is_implicit or not {"young", "poisson"} & set(self.given):
            return self._first_stable
        counts = [self.dt / asset.stable_step.recommended * self._factor(asset) for asset in self._assets]
        soft = context_of_world(self.world).contact.soft
        return math.ceil(max(*counts, 1.0, self.dt / SOFT_CONTACT_STEP if soft else 1.0) - 1e-9)

    def _factor(self, asset: SoftBodyAsset) -> float:
        """By how much faster waves are in it than they were."""
        material = asset.material
        if not isinstance(material, Material):
            return 1.0
        young, poisson = _number(material.young), _number(material.poisson)
        after = self.given.get("young", young) * _wave_factor(self.given.get("poisson", poisson))
        return math.sqrt(after / (young * _wave_factor(poisson)))

    @property
    def substeps(self) -> int:
        """Of a step: as a visitor said, or the scene, or as many as are stable."""
        if "substeps" in self.given:
            return int(self.given["substeps"])
        if self._own_substeps is not None:
            return max(self._own_substeps, self.stable_substeps)
        return self.stable_substeps

    def values(self) -> dict[str, float | None]:
        """What each slider shows; None where bodies differ, or have no such thing."""
        settings, first = self.world.settings, self._first
        own: dict[str, float | None] = {
            "young": None if first is None else _number(first.young),
            "poisson": None if first is None else _number(first.poisson),
            "damping": None if first is None else first.damping_ratio,
            "gravity": math.sqrt(sum(float(g) ** 2 for g in settings.gravity)),
            "friction": settings.friction,
            "substeps": self.substeps,
            "speed": 1.0,
        }
        return {**own, **self.given}

    def set(self, name: str, value: float) -> None:
        """Give a slider a value, checked before, and let the world have it."""
        self.given[name] = value
        if name in ("young", "poisson", "damping"):
            for body in self.world.bodies:
                self._give_material(body)
        elif name == "gravity":
            self.world.set_gravity(value * self._down)
        elif name == "friction":
            self._give_friction(value)

    def give_all(self) -> None:
        """Let the world have all that was given: after a restore, or in a world made anew."""
        for name, value in list(self.given.items()):
            self.set(name, value)

    def greet(self, body: Body) -> None:
        """Let a body that came have what the others have."""
        if {"young", "poisson", "damping"} & set(self.given):
            self._give_material(body)
        if "friction" in self.given:
            _set_friction(body, self.given["friction"])

    def _give_material(self, body: Body) -> None:
        """Bodies of springs alone have no such numbers, and stay."""
        material = self._own.get(body.index, body.asset.material)
        if isinstance(material, Material):
            names = {"young": "young", "poisson": "poisson", "damping": "damping_ratio"}
            given = {names[name]: value for name, value in self.given.items() if name in names}
            body.set_material(replace(material, **given))

    def _give_friction(self, value: float) -> None:
        if self.world.settings.floor is not None:
            self.world.set_friction(value)
        for collider in self.world.colliders:
            collider.set_friction(value)
        for body in self.world.bodies:
            _set_friction(body, value)


def _set_friction(body: Body, value: float) -> None:
    with suppress(StateError):  # bodies of this world do not touch each other
        body.set_friction(value)


def _number(constant: Any) -> float:
    """One for the whole body: the largest of several."""
    return float(constant if isinstance(constant, (int, float)) else constant.max())


def _wave_factor(poisson: float) -> float:
    """Modulus of waves of pressure over Young's modulus."""
    return (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
