"""Parameters that visitors can change while a world runs: names, ranges and effects."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from taichi_soft import PRESETS, Body, Material, SoftBodyAsset, World
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.live.choices import palette_of
from taichi_soft.solver.substeps import SOFT_CONTACT_STEP
from taichi_soft.world.world import context_of_world


@dataclass(frozen=True)
class Slider:
    """A numeric parameter.

    Args:
        name: key of the parameter.
        label, unit: text for visitors.
        low, high: the range.
        is_log: True for a logarithmic scale.
        is_whole: True for integers.
        told: short note for visitors on the cost or the stability of a change.
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
        Slider("damping", "Damping ratio", "", 0.0, 1.0, "of the slowest vibration; no extra cost"),
        Slider("gravity", "Gravity", "m/s²", 0.0, 30.0, "no extra cost"),
        Slider("friction", "Friction", "", 0.0, 2.0, "of floor, colliders and bodies; no extra cost"),
        Slider("substeps", "Substeps", "", 1, 400, "too few are unstable", is_log=True, is_whole=True),
        Slider("speed", "Slow motion", "x", 0.02, 1.0, "of real time; no extra cost", is_log=True),
    )
}
"""Sliders by name."""

MATERIAL = ("young", "poisson", "damping")
"""Names of the sliders that change materials."""

PRESET_SLIDERS: dict[str, dict[str, float]] = {
    name: {"young": each.young, "poisson": each.poisson, "damping": each.damping_ratio}
    for name, each in PRESETS.items()
    if isinstance(each.young, float)
    and isinstance(each.poisson, float)
    and SLIDERS["poisson"].low <= each.poisson <= SLIDERS["poisson"].high
}
"""Values of the material sliders, by name of the preset. Presets that the sliders cannot represent are left
out."""


@dataclass(frozen=True)
class Given:
    """Slider values and preset chosen by visitors."""

    values: dict[str, float] = field(default_factory=dict)
    preset: str | None = None

    def with_preset(self, name: str | None) -> Given:
        """Return a copy with the material values of a preset; for None, without material values."""
        others = {name: value for name, value in self.values.items() if name not in MATERIAL}
        return Given({**others, **PRESET_SLIDERS.get(name or "", {})}, name)

    def at_reset(self) -> Given:
        """Return the values after a reset: only the values of the preset, if one is chosen."""
        return Given().with_preset(self.preset)


def checked_value(name: Any, value: Any) -> float:
    """Check the value of a slider. Returns: the value, rounded if the slider has integers.

    Raises: OptionError for an unknown slider or a value out of range.
    """
    if not isinstance(name, str) or name not in SLIDERS:
        raise OptionError(f"unknown slider {name!r}")
    slider = SLIDERS[name]
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not slider.low <= value <= slider.high:  # also rejects NaN
        raise OptionError(f"{slider.label} must be from {slider.low:g} to {slider.high:g}, got {value!r}")
    return float(round(value)) if slider.is_whole else float(value)


class Controls:
    """Parameters of a world: the scene's values, and the values chosen by visitors."""

    def __init__(self, world: World, dt: float, substeps: int | None) -> None:
        self.world, self.dt = world, dt
        self.given: dict[str, float] = {}
        self.preset: str | None = None
        self._own_substeps = substeps
        self._own = {body.index: body.material for body in world.bodies}
        self._own_gravity = np.asarray(world.settings.gravity, dtype=np.float64)
        self._own_friction = world.settings.friction
        self._own_frictions = {each.index: each.friction for each in world.colliders}
        self._first = next((each for each in self._own.values() if isinstance(each, Material)), None)
        self._first_stable = world.stable_substeps(dt)
        assets = {id(body.asset): body.asset for body in world.bodies}
        self._assets = [*assets.values(), *palette_of(world).values()]
        length = float(np.linalg.norm(self._own_gravity))
        self._down = self._own_gravity / length if length else np.array([0.0, 0.0, -1.0])

    @property
    def stable_substeps(self) -> int:
        """Number of substeps that the chosen materials need, predicted from the wave speed in each asset.

        A new estimate for each body would pause the world whenever a slider moves.
        """
        has_stable_step = context_of_world(self.world).substeps.has_stable_step
        if self._first is None or not has_stable_step or not {"young", "poisson"} & set(self.given):
            return self._first_stable
        counts = [self.dt / asset.stable_step.recommended * self._factor(asset) for asset in self._assets]
        soft = context_of_world(self.world).contact.soft
        return math.ceil(max(*counts, 1.0, self.dt / SOFT_CONTACT_STEP if soft else 1.0) - 1e-9)

    def _factor(self, asset: SoftBodyAsset) -> float:
        """Return the wave speed in an asset with the chosen material, divided by its initial wave speed."""
        material = asset.material
        if not isinstance(material, Material):
            return 1.0
        young, poisson = _number(material.young), _number(material.poisson)
        after = self.given.get("young", young) * _wave_factor(self.given.get("poisson", poisson))
        return math.sqrt(after / (young * _wave_factor(poisson)))

    @property
    def substeps(self) -> int:
        """Number of substeps per step.

        It is the visitor's value if there is one, else the larger of the scene's value and `stable_substeps`.
        """
        if "substeps" in self.given:
            return int(self.given["substeps"])
        if self._own_substeps is not None:
            return max(self._own_substeps, self.stable_substeps)
        return self.stable_substeps

    def values(self) -> dict[str, float | None]:
        """Return the values of all sliders by name. A value is None if no body has the property."""
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

    @property
    def sliders(self) -> Given:
        """Slider values and preset chosen by visitors."""
        return Given(dict(self.given), self.preset)

    def set_value(self, name: str, value: float) -> None:
        """Set a slider to a checked value and apply it to the world."""
        self.given[name] = value
        self._apply({name})

    def give(self, sliders: Given) -> None:
        """Replace all chosen values. Sliders without a new value return to the scene's value."""
        changed = {*self.given, *sliders.values}
        self.given, self.preset = dict(sliders.values), sliders.preset
        self._apply(changed)

    def record(self, sliders: Given) -> None:
        """Store slider values without applying them. A restored world already has these values."""
        self.given, self.preset = dict(sliders.values), sliders.preset

    def _apply(self, names: set[str]) -> None:
        """Apply the values of the sliders `names` to the world. Each property is changed only once."""
        if names & set(MATERIAL):
            for body in self.world.bodies:
                self._give_material(body)
        if "gravity" in names:
            given = self.given.get("gravity")
            self.world.set_gravity(self._own_gravity if given is None else given * self._down)
        if "friction" in names:
            self._give_friction(self.given.get("friction"))

    def greet(self, body: Body) -> None:
        """Apply the chosen values to a newly added body."""
        if set(MATERIAL) & set(self.given):
            self._give_material(body)
        if "friction" in self.given:
            _set_friction(body, self.given["friction"])

    def _give_material(self, body: Body) -> None:
        """Apply the material sliders to a body. Skip a body of springs, because it has no material."""
        material = self._own.get(body.index, body.asset.material)
        if isinstance(material, Material):
            names = {"young": "young", "poisson": "poisson", "damping": "damping_ratio"}
            given = {names[name]: value for name, value in self.given.items() if name in names}
            body.set_material(replace(material, **given))

    def _give_friction(self, value: float | None) -> None:
        """Set the friction of all bodies, colliders and the floor; None restores the scene's values."""
        for body in self.world.bodies:
            _set_friction(body, body.asset.contact.friction if value is None else value)
        floor = self._own_friction if value is None else value
        if self.world.settings.floor is not None:
            self.world.set_friction(floor)
        for collider in self.world.colliders:
            own = self._own_frictions.get(collider.index, floor)
            collider.set_friction(own if value is None else value)


def _set_friction(body: Body, value: float) -> None:
    with suppress(StateError):  # this world has no contact between soft bodies
        body.set_friction(value)


def _number(constant: Any) -> float:
    """Return a material constant as one number: the largest value if it varies inside the body."""
    return float(constant if isinstance(constant, (int, float)) else constant.max())


def _wave_factor(poisson: float) -> float:
    """Return the P-wave modulus divided by Young's modulus."""
    return (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
