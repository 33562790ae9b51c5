"""Colour bodies by a physical quantity."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Body, MeshError, World

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Quantity:
    """A quantity to show: name, unit, and function that returns the values at a body's vertices, (n,)."""

    name: str
    unit: str
    values: Callable[[Body], Floats]


def _speeds(body: Body) -> Floats:
    return np.asarray(np.linalg.norm(body.velocities(), axis=1), dtype=np.float64)


def _flips(body: Body) -> Floats:
    found = np.zeros(body.vertex_count)
    tets: Any = getattr(body.mesh, "tets", None)
    if tets is not None:
        found[np.unique(tets[body.flipped_tets()])] = 1.0
    return found


QUANTITIES = {
    each.name: each
    for each in (
        Quantity("stress", "Pa", Body.vertex_stress),
        Quantity("strain", "", Body.vertex_strain),
        Quantity("speed", "m/s", _speeds),
        Quantity("flips", "", _flips),
    )
}
"""Quantities by name."""


class Tints:
    """Values of a quantity at the vertices of all bodies, as integers from 0 to 255, with their scale."""

    def __init__(self, quantity: str) -> None:
        self.quantity = QUANTITIES[quantity]
        self.high = 1.0 if quantity == "flips" else 0.0  # value that 255 stands for, in the quantity's unit
        self.rows = np.zeros(0, np.uint8)

    def renew(self, world: World) -> None:
        """Update the values. Adjust the scale if it is too small, or far too large, for the values."""
        found = [self._values(body) for body in world.bodies]
        values = np.concatenate(found) if found else np.zeros(0)
        if self.quantity.name != "flips" and len(values):
            most = float(np.percentile(values, 99.0))
            if most > self.high or most < 0.2 * self.high:
                self.high = _round_up(most)
        self.rows = np.clip(255.0 * values / max(self.high, 1e-12), 0.0, 255.0).astype(np.uint8)

    def _values(self, body: Body) -> Floats:
        try:
            return np.nan_to_num(self.quantity.values(body), posinf=0.0)
        except MeshError:  # a body without tetrahedra
            return np.zeros(body.vertex_count)

    @property
    def scale(self) -> dict[str, Any]:
        """Colour scale for the page: quantity, unit and range."""
        return {"quantity": self.quantity.name, "unit": self.quantity.unit, "high": self.high}


def _round_up(value: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten. Returns: 0 if `value` is not positive."""
    if value <= 0.0:
        return 0.0
    decade = 10.0 ** math.floor(math.log10(value))
    return float(next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= value))
