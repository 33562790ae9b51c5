"""Sky and floor behind bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from taichi_soft.core.types import Choice

Light = tuple[float, float, float]


class Backdrop(Choice):
    """Sky and floor colours of an image."""

    DAY = "day"  # pale checks under a blue sky
    DUSK = "dusk"  # sand under an evening sky
    MEADOW = "meadow"  # green checks under a clear sky
    PAPER = "paper"  # white paper without a horizon
    STUDIO = "studio"  # a dark floor in front of a dark wall


BackdropName: TypeAlias = Literal["day", "dusk", "meadow", "paper", "studio"]


@dataclass(frozen=True)
class BackdropColors:
    """Colours of a backdrop, in linear light.

    Args:
        horizon, zenith: colours of the sky at the horizon and overhead, with a gradient between them.
        bright, dark: colours of the floor's checks; equal colours make a plain floor.
    """

    horizon: Light
    zenith: Light
    bright: Light
    dark: Light


COLORS = {
    Backdrop.DAY: BackdropColors(
        (0.93, 0.94, 0.95), (0.21, 0.37, 0.58), (0.66, 0.635, 0.595), (0.52, 0.50, 0.47)
    ),
    Backdrop.DUSK: BackdropColors(
        (0.98, 0.60, 0.36), (0.09, 0.11, 0.28), (0.52, 0.40, 0.31), (0.42, 0.32, 0.25)
    ),
    Backdrop.MEADOW: BackdropColors(
        (0.84, 0.92, 0.96), (0.16, 0.40, 0.74), (0.34, 0.47, 0.20), (0.28, 0.40, 0.16)
    ),
    Backdrop.PAPER: BackdropColors(
        (0.86, 0.84, 0.81), (0.74, 0.73, 0.72), (0.74, 0.71, 0.67), (0.74, 0.71, 0.67)
    ),
    Backdrop.STUDIO: BackdropColors(
        (0.090, 0.095, 0.110), (0.020, 0.022, 0.030), (0.150, 0.155, 0.170), (0.135, 0.140, 0.153)
    ),
}
