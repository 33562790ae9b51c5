"""One body in a world of its own: how far it sags as it stands, and how it rings where nothing holds it."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.elements.materials import Material
from taichi_soft.world.body import Body
from taichi_soft.world.world import World

Floats = NDArray[np.float64]

SWING = 1e-3
"""Of a vibration that is measured, over the body's size: small, and far above the rounding of positions."""

SAMPLES = 12
"""Of a period: few enough to tell a frequency from rounding, many enough for the shape of the wave."""

PERIODS = 6
"""That are measured."""

STILL = 2e-3
"""Change of the height over a period, as a part of the sag, at which a body that is held back stands."""

MOST_PERIODS = 60


class Standing(NamedTuple):
    """Lowering of a body's highest point over its height, under its own weight."""

    held: float  # by its statics
    free: float  # as a game has it
    turn: float  # [rad], by which it leans from where its mesh stands
    flipped: int  # tetrahedra that are inside out, or all where the body froze


class Trial:
    """The world; its body is given each material in turn."""

    def __init__(self, asset: SoftBodyAsset) -> None:
        """Build it. Raises: StateError as `World.build`."""
        mesh = asset.mesh
        self._world = World(floor=0.0)
        self._low = float(mesh.vertices[:, 2].min())
        self._height = float(np.ptp(mesh.vertices[:, 2]))
        self._size = float(np.ptp(mesh.vertices, axis=0).max())
        self._body = self._world.add_body(asset, position=(0.0, 0.0, -self._low))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what is too soft or too slow is refused by whoever asks
            self._world.build()

    def stand(self, material: Material, gravity_scale: float, period: float, seconds: float) -> Standing:
        """Put it on the floor as its mesh is, held back by a drag until nothing moves; then let it go.

        Args:
            period: of its slowest vibration [s].
            seconds: that it moves freely.
        """
        body = self._take(material, gravity_scale, 2 * np.pi / period)
        body.set_motion(self._placed(0.0), np.zeros_like(body.asset.mesh.vertices))
        before = held = 0.0
        for _ in range(MOST_PERIODS):
            before, held = held, self._sag_over(period)
            if abs(held - before) <= STILL * abs(held):
                break
        body.set_linear_damping(0.0)
        free = [self._sag_over(period) for _ in range(int(np.ceil(seconds / period)))]
        turn = np.arccos(np.clip((np.trace(body.pose().rotation) - 1) / 2, -1.0, 1.0))
        flipped = len(body.tets) if body.is_frozen else body.flipped_count()
        return Standing(held, float(np.mean(free[-2:])) if free else held, float(turn), flipped)

    def ring(self, material: Material, mode: Floats, period: float) -> tuple[float, float]:
        """Let it swing in a mode, far above the floor and without weight: frequency [Hz] and rate at which
        the amplitude falls [1/s].

        A sample of a damped wave is a sum of its two last ones, by factors that tell both (Prony 1795); here
        by least squares over all samples.
        Args:
            mode: (n, 3), the largest entry being 1.
            period: about that of the mode [s].
        """
        body = self._take(material, 0.0, 0.0)
        rest = self._placed(2.0 * self._size)
        body.set_motion(rest, SWING * self._size * 2 * np.pi / period * mode)
        weights = body.masses[:, None] * mode
        wave = [0.0]
        for _ in range(SAMPLES * PERIODS):
            self._world.step(period / SAMPLES)
            wave.append(float((weights * (body.positions() - rest)).sum()))
        q = np.array(wave)
        (first, second), *_ = np.linalg.lstsq(np.stack([q[1:-1], q[:-2]], axis=1), q[2:], rcond=None)
        shrink = np.sqrt(max(-second, 1e-12))
        turn = np.arccos(np.clip(first / (2 * shrink), -1.0, 1.0))
        dt = period / SAMPLES
        return float(turn / (2 * np.pi * dt)), float(-np.log(shrink) / dt)

    def _take(self, material: Material, gravity_scale: float, drag: float) -> Body:
        body = self._body
        body.set_material(material)
        body.set_gravity_scale(gravity_scale)
        body.set_linear_damping(drag)
        return body

    def _placed(self, height: float) -> Floats:
        rest = self._body.asset.mesh.vertices
        placed: Floats = rest + np.array([0.0, 0.0, height - self._low])
        return placed

    def _sag_over(self, period: float) -> float:
        """Go on for a period [s]: mean lowering of the highest point over the height."""
        count = max(SAMPLES, int(np.ceil(60.0 * period)))  # a step is no longer than a frame of a game
        highest = []
        for _ in range(count):
            self._world.step(period / count)
            highest.append(float(self._body.positions()[:, 2].max()))
        return 1.0 - float(np.mean(highest)) / self._height
