"""Measure the sag of a body on a floor, and its free vibration, in a separate world."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.elements.materials import Material
from taichi_soft.world.bare import bare_world
from taichi_soft.world.body import Body

Floats = NDArray[np.float64]

AMPLITUDE = 1e-3
"""Amplitude of a measured vibration, as a fraction of the body's size. It is small, but far above the
rounding errors of positions."""

SAMPLES = 12
"""Number of samples per period. With more samples, rounding errors change the frequency; with fewer, the
samples do not resolve the wave."""

PERIODS = 6
"""Number of measured periods."""

SETTLED_CHANGE = 2e-3
"""Largest relative change of the sag within a period. If the sag changes less, a damped body counts as
standing."""

MAX_PERIODS = 60
"""Number of periods after which a damped body counts as standing, even if its sag still changes."""


class Standing(NamedTuple):
    """Sag and lean of a standing body.

    The sag is the lowering of the highest point under the body's own weight, relative to the height.
    """

    static_sag: float  # sag at rest, with drag
    free_sag: float  # sag without drag, as in a game
    lean: float  # rotation from the pose of the mesh [rad]
    inverted: int  # number of inverted tetrahedra; all tetrahedra if the body froze


class Trial:
    """World with a single body, in which materials are tested one after another."""

    def __init__(self, asset: SoftBodyAsset) -> None:
        """Build the world. Raises: StateError, see `World.build`."""
        mesh = asset.mesh
        self._world = bare_world(floor=0.0)
        self._lowest = float(mesh.vertices[:, 2].min())
        self._height = float(np.ptp(mesh.vertices[:, 2]))
        self._size = float(np.ptp(mesh.vertices, axis=0).max())
        self._body = self._world.add_body(asset, position=(0.0, 0.0, -self._lowest))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the caller refuses materials that are too soft or too stiff
            self._world.build()

    def stand(self, material: Material, gravity_scale: float, period: float, seconds: float) -> Standing:
        """Put the body on the floor in the pose of its mesh, with drag until it rests; then remove the drag.

        Args:
            period: period of the body's slowest vibration [s].
            seconds: time without drag [s].
        """
        body = self._prepare(material, gravity_scale, 2 * np.pi / period)
        body.set_motion(self._positions_at(0.0), np.zeros_like(body.asset.mesh.vertices))
        before = sag = 0.0
        for _ in range(MAX_PERIODS):
            before, sag = sag, self._sag_over(period)
            if abs(sag - before) <= SETTLED_CHANGE * abs(sag):
                break
        body.set_linear_damping(0.0)
        free_sags = [self._sag_over(period) for _ in range(int(np.ceil(seconds / period)))]
        lean = np.arccos(np.clip((np.trace(body.pose().rotation) - 1) / 2, -1.0, 1.0))
        inverted = len(body.tets) if body.is_frozen else body.flipped_count()
        return Standing(sag, float(np.mean(free_sags[-2:])) if free_sags else sag, float(lean), inverted)

    def ring_down(self, material: Material, mode: Floats, period: float) -> tuple[float, float]:
        """Let the body vibrate in a mode, without contact and gravity.

        Each sample of a damped wave is a linear combination of the two previous samples. The two coefficients
        are fitted by least squares over all samples, and give frequency and decay (Prony 1795).
        Args:
            mode: (n, 3), with a largest entry of 1.
            period: approximate period of the mode [s].
        Returns: the frequency [Hz], and the decay rate of the amplitude [1/s].
        """
        body = self._prepare(material, 0.0, 0.0)
        rest = self._positions_at(2.0 * self._size)
        body.set_motion(rest, AMPLITUDE * self._size * 2 * np.pi / period * mode)
        weights = body.masses[:, None] * mode
        wave = [0.0]
        for _ in range(SAMPLES * PERIODS):
            self._world.step(period / SAMPLES)
            wave.append(float((weights * (body.positions() - rest)).sum()))
        q = np.array(wave)
        (first, second), *_ = np.linalg.lstsq(np.stack([q[1:-1], q[:-2]], axis=1), q[2:], rcond=None)
        decay = np.sqrt(max(-second, 1e-12))
        angle = np.arccos(np.clip(first / (2 * decay), -1.0, 1.0))
        dt = period / SAMPLES
        return float(angle / (2 * np.pi * dt)), float(-np.log(decay) / dt)

    def _prepare(self, material: Material, gravity_scale: float, drag: float) -> Body:
        body = self._body
        body.set_material(material)
        body.set_gravity_scale(gravity_scale)
        body.set_linear_damping(drag)
        return body

    def _positions_at(self, height: float) -> Floats:
        rest = self._body.asset.mesh.vertices
        positions: Floats = rest + np.array([0.0, 0.0, height - self._lowest])
        return positions

    def _sag_over(self, period: float) -> float:
        """Step for a period [s]. Returns: mean lowering of the highest point, relative to the height."""
        count = max(SAMPLES, int(np.ceil(60.0 * period)))  # at least 60 steps per second, as in a game
        highest = []
        for _ in range(count):
            self._world.step(period / count)
            highest.append(float(self._body.positions()[:, 2].max()))
        return 1.0 - float(np.mean(highest)) / self._height
