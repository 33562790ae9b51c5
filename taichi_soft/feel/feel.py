"""Find a material for a requested behaviour: sag, vibration frequency and settling time."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from math import degrees, inf, log, nan, pi, sqrt

import numpy as np

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.first_mode import first_mode
from taichi_soft.bodies.sag import MAX_SAG
from taichi_soft.core.checks import as_number
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import LawName
from taichi_soft.elements.materials import Material
from taichi_soft.elements.materials.material import DAMPING_RATIO
from taichi_soft.feel.trial import Trial
from taichi_soft.meshing import TetMesh
from taichi_soft.solver.substeps import FRAME, MANY_SUBSTEPS

_log = logging.getLogger(__name__)

SETTLED = 0.05
"""Fraction of a vibration's amplitude that remains after the settling time. Control engineering commonly uses
this value."""

DECAY_FACTOR = -log(SETTLED)
"""Product of the decay rate and the settling time of a vibration."""

MODE_TOLERANCE = 1e-5
"""Relative change of the squared frequency below which the search for the slowest mode ends."""

TOLERANCE, GUARANTEED = 0.015, 0.05
"""TOLERANCE: relative error of all targets at which the search ends. GUARANTEED: largest relative error of a
result. It is larger, because the floor and the steps of a game differ slightly from those of the search."""

MAX_TRIALS = 8
"""Largest number of simulations in a search."""

SAG_RANGE = 1e-3, 0.3
"""Range of allowed sags, as fractions of the height. Below this range, a body looks rigid and rounding errors
matter. Above this range, tetrahedra invert."""

GRAVITY_SCALE_RANGE = 0.05, 20.0
"""Range of allowed gravity scales. Outside this range, motion does not look natural."""

PERIOD_RANGE = 1.0, 100.0
"""Range of allowed settling times, in periods of the vibration. With fewer periods, the motion does not look
like a vibration. With more periods, the vibration seems never to end."""

MAX_LEAN = 0.2
"""Largest angle between a standing body and its initial pose [rad]. A body beyond this angle rolls or tips
over."""


@dataclass(frozen=True)
class Behaviour:
    """Sag, frequency and settling time of a body."""

    sag: float  # lowering of the highest point by the weight, relative to the height; nan if it tips over
    wobble_hz: float  # frequency of the slowest vibration of the free body [Hz]
    settle_s: float  # time after which 5 % of the amplitude of this vibration remains [s]

    def __str__(self) -> str:
        return f"sag {self.sag:.3g}, wobble_hz {self.wobble_hz:.3g}, settle_s {self.settle_s:.3g}"


@dataclass(frozen=True)
class Feel:
    """Result of `material_from_feel`."""

    material: Material  # material to pass to `World.add_body`
    gravity_scale: float  # value for `Body.set_gravity_scale`; 1 unless both sag and wobble_hz were requested
    predicted: Behaviour  # calculated from statics and from the slowest mode
    simulated: Behaviour  # measured in a simulation, on a floor and in the air


def material_from_feel(
    mesh: TetMesh,
    *,
    sag: float | None = None,
    wobble_hz: float | None = None,
    settle_s: float | None = None,
    poisson: float = 0.4,
    density: float = 1000.0,
    law: LawName | None = None,
) -> Feel:
    """Find the Young's modulus, gravity_scale and damping that give a body the requested behaviour.

    Sag and frequency both depend on Young's modulus. If both are requested, the frequency sets Young's
    modulus and gravity is scaled for the sag. The result is simulated, and meets each target within 5 %. The
    search takes seconds, and starts Taichi with default settings if `init` was not called.
    Args:
        mesh: the body at rest, standing upright with z up. For an artist's mesh, pass the cage, `asset.mesh`.
        sag: lowering of the body's highest point when it stands on a floor, relative to its height.
        wobble_hz: frequency of the slowest vibration of the free body [Hz].
        settle_s: time after which 5 % of the amplitude of this vibration remains [s]; None for the default
            damping_ratio of `Material`.
        poisson: Poisson's ratio, as in `Material`.
        density: [kg/m^3].
        law: law of the body, as in `SoftBodyAsset`.
    Raises: OptionError for targets that are out of range or cannot be met together, with the nearest
        possible target; MeshError and MaterialError for the same reasons as `SoftBodyAsset`.
    Example:
        feel = material_from_feel(sphere(radius=0.3), sag=0.05, settle_s=0.8)
        print(feel.material)
    """
    if not isinstance(mesh, TetMesh):
        raise OptionError(f"mesh must be a TetMesh, for example asset.mesh, got {mesh!r}")
    sag = None if sag is None else as_number(sag, "sag", *SAG_RANGE)
    wobble_hz = None if wobble_hz is None else as_number(wobble_hz, "wobble_hz", 1e-3, 1e5)
    settle_s = None if settle_s is None else as_number(settle_s, "settle_s", 1e-4, 1e5)
    if sag is None and wobble_hz is None:
        raise OptionError("sag or wobble_hz must be given: settle_s alone leaves Young's modulus open")
    body = _Body(mesh, poisson, density, law)
    return _Search(body, sag, wobble_hz, settle_s).run()


class _Body:
    """The body whose Young's modulus, gravity and damping are sought, in a separate world."""

    def __init__(self, mesh: TetMesh, poisson: float, density: float, law: LawName | None) -> None:
        self.constants = poisson, density
        material = Material(1e5, poisson, density)
        self.asset = SoftBodyAsset(mesh, material, law=law)
        if self.asset.description.bonds is not None:
            raise OptionError(
                f"law {law!r} has no Young's modulus: use another law, for example 'neo_hookean'"
            )
        omega, self.mode = first_mode(self.asset.description, MODE_TOLERANCE)
        if omega == 0.0:
            raise OptionError(f"{mesh!r} has no vibration mode: use a finer mesh")
        height = float(np.ptp(mesh.vertices[:, 2]))
        self.weight = density * GRAVITY_EARTH * height  # pressure under a column of the body's height [Pa]
        # Angular frequency of the slowest mode, the estimate of this frequency that damping ratios refer
        # to, and number of substeps of a frame. All three are divided by sqrt(young).
        self.speed = omega / sqrt(1e5)
        self.estimate = self.asset.first_frequency / sqrt(1e5)
        self.substeps = FRAME / self.asset.stable_step.recommended / sqrt(1e5)
        self.trial = Trial(self.asset)

    def material(self, young: float, rate: float) -> Material:
        """Return the material whose slowest mode decays at `rate` [1/s]."""
        poisson, density = self.constants
        return Material(young, poisson, density, damping_ratio=rate / (self.estimate * sqrt(young)))

    def omega(self, young: float) -> float:
        """Return the angular frequency of the slowest mode without damping [rad/s]."""
        return self.speed * sqrt(young)

    def static_sag(self, weight_ratio: float) -> float:
        """Return the static sag of the body if `weight` is `weight_ratio` times Young's modulus."""
        young = self.weight / MAX_SAG
        material = self.material(young, DAMPING_RATIO * self.omega(young))
        standing = self.trial.stand(material, weight_ratio / MAX_SAG, 2 * pi / self.omega(young), 0.0)
        _require_upright(standing.lean)
        return standing.static_sag

    def weight_ratio_for(self, sag: float) -> float:
        """Find the ratio of `weight` to Young's modulus that gives a sag, by the secant method on logarithms.

        Raises: OptionError if the body would be too soft.
        """
        weight_ratio, power, before = min(2 * sag, MAX_SAG), 1.0, (0.0, 0.0)
        for _ in range(MAX_TRIALS):
            result = self.static_sag(weight_ratio)
            if weight_ratio == MAX_SAG and result < sag * (1 - TOLERANCE):
                raise OptionError(
                    f"sag must be at most {0.99 * result:.3g} for this body, got {sag:g}: a softer body "
                    "turns inside out when it lands"
                )
            if abs(result / sag - 1) <= TOLERANCE:
                break
            point = log(weight_ratio), log(result)
            if before != (0.0, 0.0) and abs(point[0] - before[0]) > 1e-3:
                power = min(max((point[1] - before[1]) / (point[0] - before[0]), 0.4), 2.0)
            before = point
            weight_ratio = min(weight_ratio * (sag / result) ** (1 / power), MAX_SAG)
        return weight_ratio


class _Search:
    """Search for the constants of a body that meet the targets."""

    def __init__(
        self, body: _Body, sag: float | None, wobble_hz: float | None, settle_s: float | None
    ) -> None:
        self.body, self.sag, self.wobble_hz, self.settle_s = body, sag, wobble_hz, settle_s
        self.target_rate = 0.0 if settle_s is None else DECAY_FACTOR / settle_s
        self.weight_ratio = 0.0 if sag is None else body.weight_ratio_for(sag)
        if wobble_hz is None:
            self.young = body.weight / self.weight_ratio
        else:  # damping lowers the frequency
            self.young = ((2 * pi * wobble_hz) ** 2 + self.target_rate**2) / body.speed**2

    @property
    def rate(self) -> float:
        """Decay rate of the slowest mode [1/s]."""
        return self.target_rate or DAMPING_RATIO * self.body.omega(self.young)

    @property
    def gravity_scale(self) -> float:
        """Gravity scale for the requested sag; 1 unless both a sag and a frequency are requested."""
        scales_gravity = self.sag is not None and self.wobble_hz is not None
        return self.weight_ratio * self.young / self.body.weight if scales_gravity else 1.0

    def run(self) -> Feel:
        """Simulate, and correct each constant by the error of its target, until all targets are met."""
        for _ in range(MAX_TRIALS):
            self._check()
            feel = self._evaluate()
            _log.info("%r, gravity x %.3g: %s", feel.material, feel.gravity_scale, feel.simulated)
            if self._largest_error(feel.simulated) <= TOLERANCE:
                break
            self._correct(feel.simulated)
        if not self._largest_error(feel.simulated) <= GUARANTEED:
            raise OptionError(
                f"these targets cannot be met together: the nearest result found is {feel.simulated}"
            )
        return feel

    def _evaluate(self) -> Feel:
        """Return the material with the current constants, and its predicted and simulated behaviour."""
        omega, trial = self.body.omega(self.young), self.body.trial
        period, settle = 2 * pi / omega, DECAY_FACTOR / self.rate
        material = self.body.material(self.young, self.rate)
        frequency, rate = trial.ring_down(material, self.body.mode, period)
        standing = trial.stand(material, self.gravity_scale, period, settle)
        if standing.inverted:
            raise OptionError(
                f"the body is too soft for its own weight: {standing.inverted} tetrahedra are inverted. "
                "Request less sag or a higher wobble_hz"
            )
        if self.sag is not None:
            _require_upright(standing.lean)
        predicted_sag, simulated_sag = (
            (standing.static_sag, standing.free_sag) if standing.lean <= MAX_LEAN else (nan, nan)
        )
        predicted = Behaviour(predicted_sag, sqrt(omega**2 - self.rate**2) / (2 * pi), settle)
        simulated = Behaviour(simulated_sag, frequency, DECAY_FACTOR / rate if rate > 0 else inf)
        return Feel(material, self.gravity_scale, predicted, simulated)

    def _largest_error(self, result: Behaviour) -> float:
        """Return the largest relative error of all targets."""
        pairs = (self.sag, result.sag), (self.wobble_hz, result.wobble_hz), (self.settle_s, result.settle_s)
        return max(abs(value / target - 1) for target, value in pairs if target is not None)

    def _correct(self, result: Behaviour) -> None:
        if self.settle_s is not None:
            self.target_rate *= result.settle_s / self.settle_s
        if self.sag is not None:
            self.weight_ratio *= self.sag / result.sag
        if self.wobble_hz is not None:
            self.young *= (self.wobble_hz / result.wobble_hz) ** 2
        else:
            self.young = self.body.weight / self.weight_ratio

    def _check(self) -> None:
        """Raise an OptionError with the nearest possible target if the constants are impractical."""
        body, omega = self.body, self.body.omega(self.young)
        hz = sqrt(max(omega**2 - self.rate**2, 0.0)) / (2 * pi)
        periods = hz * DECAY_FACTOR / self.rate
        if not PERIOD_RANGE[0] <= periods <= PERIOD_RANGE[1]:
            count = min(max(periods, PERIOD_RANGE[0]), PERIOD_RANGE[1])
            nearest = count / hz if self.wobble_hz else sqrt((2 * pi * count) ** 2 + DECAY_FACTOR**2) / omega
            raise OptionError(
                f"settle_s={DECAY_FACTOR / self.rate:.3g} is {periods:.3g} periods at {hz:.3g} Hz, outside "
                f"the range {PERIOD_RANGE[0]:g} to {PERIOD_RANGE[1]:g}: the nearest settle_s is {nearest:.3g}"
            )
        scale = self.gravity_scale
        if not GRAVITY_SCALE_RANGE[0] <= scale <= GRAVITY_SCALE_RANGE[1]:
            nearest = hz * sqrt(min(max(scale, GRAVITY_SCALE_RANGE[0]), GRAVITY_SCALE_RANGE[1]) / scale)
            raise OptionError(
                f"sag={self.sag:g} at {hz:.3g} Hz needs a gravity_scale of {scale:.3g}, outside the range "
                f"from {GRAVITY_SCALE_RANGE[0]:g} to {GRAVITY_SCALE_RANGE[1]:g}: with this sag the nearest "
                f"wobble_hz is {nearest:.3g}"
            )
        weight_ratio = scale * body.weight / self.young
        if weight_ratio > MAX_SAG * (1 + GUARANTEED):
            raise OptionError(
                f"wobble_hz={hz:.3g} makes the body so soft that its own weight turns it inside out: the "
                f"nearest wobble_hz is {hz * sqrt(weight_ratio / MAX_SAG):.3g}; a sag would scale gravity too"
            )
        excess = body.substeps * sqrt(self.young) / MANY_SUBSTEPS
        if excess > 1.0:
            if self.wobble_hz is None and self.sag is not None:
                hint = f"the nearest sag is {self.sag * excess**2:.3g}"
            else:
                hint = f"the nearest wobble_hz is {hz / excess:.3g}"
            raise OptionError(
                f"the body is so stiff that a 60 Hz frame needs {MANY_SUBSTEPS * excess:,.0f} substeps, "
                f"above the limit of {MANY_SUBSTEPS}: {hint}, or use a coarser mesh"
            )


def _require_upright(lean: float) -> None:
    """Check that a body stands. Raises: OptionError if it leans by more than `MAX_LEAN` [rad]."""
    if lean > MAX_LEAN:
        raise OptionError(
            f"the body does not stand as its mesh is oriented: it leans by {degrees(lean):.0f} degrees. "
            "Rotate the mesh so that it stands with z up, or request wobble_hz without sag"
        )
