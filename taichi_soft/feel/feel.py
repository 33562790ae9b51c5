"""A material from what a body should do: sag so far, wobble so fast, settle so soon."""

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
"""What is left of a vibration when it has settled: the 5 % settling time of control engineering."""

DECAYS = -log(SETTLED)
"""Rate of a vibration times its settling time."""

EXACT = 1e-5
"""Change of the squared frequency at which the slowest mode is known well enough."""

CLOSE, PROMISED = 0.015, 0.05
"""Of a wish: at which the search ends, and what it promises. A game's floor and steps differ a little."""

MOST_TRIALS = 8

SAGS = 1e-3, 0.3
"""Below, a body looks rigid and rounding counts; above, none was seen that stays whole."""

SCALES = 0.05, 20.0
"""Of gravity: beyond, nothing falls like this."""

SWINGS = 1.0, 100.0
"""Periods until a vibration has settled: fewer are not seen as a vibration, more not as its end."""

LEANS = 0.2
"""Turn of a body [rad] from which on it does not stand: it rolls or tips over."""


@dataclass(frozen=True)
class Behaviour:
    """How a body behaves."""

    sag: float  # lowering of its highest point as it stands on a floor, over its height; nan if it tips over
    wobble_hz: float  # frequency of its slowest vibration where nothing holds it [Hz]
    settle_s: float  # time after which a twentieth of that vibration is left [s]

    def __str__(self) -> str:
        return f"sag {self.sag:.3g}, wobble_hz {self.wobble_hz:.3g}, settle_s {self.settle_s:.3g}"


@dataclass(frozen=True)
class Feel:
    """What `material_from_feel` found."""

    material: Material  # for `World.add_body`
    gravity_scale: float  # for `Body.set_gravity_scale`; 1 unless both sag and wobble_hz were wished for
    predicted: Behaviour  # by its statics, and by its slowest mode
    simulated: Behaviour  # as in a game: put down on a floor, and ringing in the air


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
    """The Young's modulus, gravity_scale and damping with which a body behaves as wished.

    Sag and frequency both follow from Young's modulus. One of them sets it; where both are wished for, the
    frequency does, and gravity is scaled for the sag. What is found is simulated, and meets each wish to 5 %.
    It takes seconds, and starts Taichi as it is by default where nobody has called `init`.
    Args:
        mesh: the body at rest, as it stands, z being up. Of an artist's mesh the cage, `asset.mesh`.
        sag: lowering of its highest point as it stands on a floor, over its height.
        wobble_hz: frequency of its slowest vibration where nothing holds it [Hz].
        settle_s: time after which a twentieth of that vibration is left [s]; None takes the damping_ratio
            that a `Material` has if nothing is said.
        poisson: of the material, as `Material` takes it.
        density: [kg/m^3].
        law: of the body, as `SoftBodyAsset` takes it.
    Raises: OptionError for wishes that are out of range or cannot be met together, with the nearest that
        can; MeshError and MaterialError as `SoftBodyAsset`.
    Example:
        feel = material_from_feel(sphere(radius=0.3), sag=0.05, settle_s=0.8)
        print(feel.material)
    """
    if not isinstance(mesh, TetMesh):
        raise OptionError(f"mesh must be a TetMesh, such as asset.mesh, got {mesh!r}")
    sag = None if sag is None else as_number(sag, "sag", *SAGS)
    wobble_hz = None if wobble_hz is None else as_number(wobble_hz, "wobble_hz", 1e-3, 1e5)
    settle_s = None if settle_s is None else as_number(settle_s, "settle_s", 1e-4, 1e5)
    if sag is None and wobble_hz is None:
        raise OptionError("sag or wobble_hz must be given: settle_s alone leaves Young's modulus open")
    body = _Body(mesh, poisson, density, law)
    return _Search(body, sag, wobble_hz, settle_s).found()


class _Body:
    """A body of which Young's modulus, gravity and damping are open, in a world of its own."""

    def __init__(self, mesh: TetMesh, poisson: float, density: float, law: LawName | None) -> None:
        self.constants = poisson, density
        material = Material(1e5, poisson, density)
        self.asset = SoftBodyAsset(mesh, material, law=law)
        if self.asset.description.bonds is not None:
            raise OptionError(f"law {law!r} has no Young's modulus of its own: 'neo_hookean' has")
        omega, self.mode = first_mode(self.asset.description, EXACT)
        if omega == 0.0:
            raise OptionError(f"{mesh!r} has no vibration of its own: take a finer mesh")
        height = float(np.ptp(mesh.vertices[:, 2]))
        self.weight = density * GRAVITY_EARTH * height  # of a column as high as the body [Pa]
        self.speed = omega / sqrt(1e5)  # of the slowest mode, over the root of Young's modulus
        self.estimate = self.asset.first_frequency / sqrt(1e5)  # to which a damping ratio belongs
        self.substeps = FRAME / self.asset.stable_step.recommended / sqrt(1e5)  # the same, of a frame
        self.trial = Trial(self.asset)

    def material(self, young: float, rate: float) -> Material:
        """One whose slowest mode fades at a rate [1/s]."""
        poisson, density = self.constants
        return Material(young, poisson, density, damping_ratio=rate / (self.estimate * sqrt(young)))

    def omega(self, young: float) -> float:
        """Angular frequency of its slowest mode, undamped [rad/s]."""
        return self.speed * sqrt(young)

    def sag_of(self, share: float) -> float:
        """How far it sags, by its statics, if its column weighs `share` of Young's modulus."""
        young = self.weight / MAX_SAG
        material = self.material(young, DAMPING_RATIO * self.omega(young))
        standing = self.trial.stand(material, share / MAX_SAG, 2 * pi / self.omega(young), 0.0)
        _require_upright(standing.turn)
        return standing.held

    def share_for(self, sag: float) -> float:
        """Weight over Young's modulus with which it sags so far: by secants of logarithms.

        Raises: OptionError where it would take too soft a body.
        """
        share, power, before = min(2 * sag, MAX_SAG), 1.0, (0.0, 0.0)
        for _ in range(MOST_TRIALS):
            seen = self.sag_of(share)
            if share == MAX_SAG and seen < sag * (1 - CLOSE):
                raise OptionError(
                    f"sag must be at most {0.99 * seen:.3g} for this body, got {sag:g}: what is softer turns "
                    "inside out where it lands"
                )
            if abs(seen / sag - 1) <= CLOSE:
                break
            point = log(share), log(seen)
            if before != (0.0, 0.0) and abs(point[0] - before[0]) > 1e-3:
                power = min(max((point[1] - before[1]) / (point[0] - before[0]), 0.4), 2.0)
            before = point
            share = min(share * (sag / seen) ** (1 / power), MAX_SAG)
        return share


class _Search:
    """The constants of a body for some wishes."""

    def __init__(
        self, body: _Body, sag: float | None, wobble_hz: float | None, settle_s: float | None
    ) -> None:
        self.body, self.sag, self.wobble_hz, self.settle_s = body, sag, wobble_hz, settle_s
        self.wished_rate = 0.0 if settle_s is None else DECAYS / settle_s
        self.share = 0.0 if sag is None else body.share_for(sag)
        if wobble_hz is None:
            self.young = body.weight / self.share
        else:  # a damped vibration is slower than an undamped one
            self.young = ((2 * pi * wobble_hz) ** 2 + self.wished_rate**2) / body.speed**2

    @property
    def rate(self) -> float:
        """At which the slowest mode is to fade [1/s]."""
        return self.wished_rate or DAMPING_RATIO * self.body.omega(self.young)

    @property
    def gravity_scale(self) -> float:
        """With which it sags as wished."""
        is_free = self.sag is not None and self.wobble_hz is not None
        return self.share * self.young / self.body.weight if is_free else 1.0

    def found(self) -> Feel:
        """Simulate, and correct each constant by what its wish was missed by, until all are met."""
        for _ in range(MOST_TRIALS):
            self._require()
            feel = self._tried()
            _log.info("%r, gravity x %.3g: %s", feel.material, feel.gravity_scale, feel.simulated)
            if self._miss(feel.simulated) <= CLOSE:
                break
            self._correct(feel.simulated)
        if not self._miss(feel.simulated) <= PROMISED:
            raise OptionError(
                f"these wishes cannot be met together; the nearest that was found is {feel.simulated}"
            )
        return feel

    def _tried(self) -> Feel:
        """What the constants make of the body, by its statics and slowest mode, and in a simulation."""
        omega, trial = self.body.omega(self.young), self.body.trial
        period, settle = 2 * pi / omega, DECAYS / self.rate
        material = self.body.material(self.young, self.rate)
        frequency, rate = trial.ring(material, self.body.mode, period)
        standing = trial.stand(material, self.gravity_scale, period, settle)
        if standing.flipped:
            raise OptionError(
                f"so soft a body does not bear its own weight: {standing.flipped} tetrahedra are inside out. "
                "Wish for less sag or a higher wobble_hz"
            )
        if self.sag is not None:
            _require_upright(standing.turn)
        held, free = (standing.held, standing.free) if standing.turn <= LEANS else (nan, nan)
        predicted = Behaviour(held, sqrt(omega**2 - self.rate**2) / (2 * pi), settle)
        simulated = Behaviour(free, frequency, DECAYS / rate if rate > 0 else inf)
        return Feel(material, self.gravity_scale, predicted, simulated)

    def _miss(self, seen: Behaviour) -> float:
        """Share by which the wish is missed that is missed most."""
        pairs = (self.sag, seen.sag), (self.wobble_hz, seen.wobble_hz), (self.settle_s, seen.settle_s)
        return max(abs(got / wish - 1) for wish, got in pairs if wish is not None)

    def _correct(self, seen: Behaviour) -> None:
        if self.settle_s is not None:
            self.wished_rate *= seen.settle_s / self.settle_s
        if self.sag is not None:
            self.share *= self.sag / seen.sag
        if self.wobble_hz is not None:
            self.young *= (self.wobble_hz / seen.wobble_hz) ** 2
        else:
            self.young = self.body.weight / self.share

    def _require(self) -> None:
        """Raises: OptionError for constants that no game wants, with the nearest wish that gives others."""
        body, omega = self.body, self.body.omega(self.young)
        hz = sqrt(max(omega**2 - self.rate**2, 0.0)) / (2 * pi)
        swings = hz * DECAYS / self.rate
        if not SWINGS[0] <= swings <= SWINGS[1]:
            count = min(max(swings, SWINGS[0]), SWINGS[1])
            nearest = count / hz if self.wobble_hz else sqrt((2 * pi * count) ** 2 + DECAYS**2) / omega
            raise OptionError(
                f"settle_s {DECAYS / self.rate:.3g} is {swings:.3g} periods at {hz:.3g} Hz, where "
                f"{SWINGS[0]:g} to {SWINGS[1]:g} can be: the nearest is {nearest:.3g}"
            )
        scale = self.gravity_scale
        if not SCALES[0] <= scale <= SCALES[1]:
            nearest = hz * sqrt(min(max(scale, SCALES[0]), SCALES[1]) / scale)
            raise OptionError(
                f"sag {self.sag:g} at {hz:.3g} Hz takes a gravity_scale of {scale:.3g}, where "
                f"{SCALES[0]:g} to {SCALES[1]:g} can be: with this sag the nearest wobble_hz is {nearest:.3g}"
            )
        share = scale * body.weight / self.young
        if share > MAX_SAG * (1 + PROMISED):
            raise OptionError(
                f"wobble_hz {hz:.3g} is so soft that the body turns inside out by its own weight: the "
                f"nearest is {hz * sqrt(share / MAX_SAG):.3g}, or wish for a sag, which scales gravity"
            )
        excess = body.substeps * sqrt(self.young) / MANY_SUBSTEPS
        if excess > 1.0:
            if self.wobble_hz is None and self.sag is not None:
                way_out = f"the nearest sag is {self.sag * excess**2:.3g}"
            else:
                way_out = f"the nearest wobble_hz is {hz / excess:.3g}"
            raise OptionError(
                f"so stiff a body takes {MANY_SUBSTEPS * excess:,.0f} substeps of a 60 Hz frame, where "
                f"{MANY_SUBSTEPS} can be: {way_out}. A coarser mesh takes fewer"
            )


def _require_upright(turn: float) -> None:
    """Raises: OptionError for a body that leans by too much [rad] to have a sag."""
    if turn > LEANS:
        raise OptionError(
            f"the body does not stand as its mesh is: it leans by {degrees(turn):.0f} degrees. Turn the mesh "
            "so that it stands, z being up, or wish for wobble_hz without sag"
        )
