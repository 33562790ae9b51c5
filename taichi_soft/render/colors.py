"""Colours of bodies, and colour maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array, as_number, to_array
from taichi_soft.core.errors import OptionError
from taichi_soft.render.arguments import as_color
from taichi_soft.render.opencv import cv2

Color = tuple[float, float, float]

PALETTE: tuple[Color, ...] = (
    (0.91, 0.42, 0.32),  # coral
    (0.16, 0.58, 0.62),  # teal
    (0.95, 0.70, 0.28),  # honey
    (0.40, 0.45, 0.78),  # periwinkle
    (0.50, 0.70, 0.38),  # leaf
    (0.80, 0.42, 0.60),  # rose
    (0.32, 0.62, 0.85),  # sky
    (0.66, 0.50, 0.38),  # clay
)
"""Body colours, sRGB from 0 to 1, with different hues and similar lightness. After the last
colour, begin again with the first."""

RAMP: tuple[Color, ...] = (
    (0.30, 0.52, 0.80),
    (0.42, 0.75, 0.76),
    (0.95, 0.88, 0.52),
    (0.95, 0.57, 0.28),
    (0.80, 0.18, 0.22),
)
"""Colours of a `ColorScale` at equal steps, sRGB from 0 to 1."""

PREFIXES = (("G", 1e9), ("M", 1e6), ("k", 1e3), ("", 1.0))
"""Prefixes of SI units and their factors, largest first. A label has a prefix if its value is at least ten
times the factor of the prefix."""

FLIPPED: Color = (0.93, 0.10, 0.42)
"""Colour of inverted tetrahedra, sRGB from 0 to 1. `PALETTE` does not contain it."""


def colormap(values: ArrayLike, low: float, high: float) -> NDArray[np.float32]:
    """Map numbers to colours with viridis, from dark violet (`low`) to bright yellow (`high`).

    Args:
        values: (n,), one per vertex; values out of range are clamped.
        low, high: the range, low < high.
    Returns: sRGB from 0 to 1, float32 (n, 3).
    Raises: OptionError for values that are not finite or an empty range.
    """
    place = _places(values, low, high) * 255.0
    # OpenCV's table has only 256 colours, so interpolate between them.
    table = cv2.applyColorMap(np.arange(256, dtype=np.uint8).reshape(-1, 1), cv2.COLORMAP_VIRIDIS)
    rgb = table[:, 0, ::-1].astype(np.float32) / 255.0
    channels = [np.interp(place, np.arange(256), rgb[:, k]) for k in range(3)]
    return np.stack(channels, axis=1).astype(np.float32)


def _places(values: ArrayLike, low: float, high: float) -> NDArray[np.float64]:
    """Scale numbers from [low, high] to [0, 1], (n,). Raises: the errors of `colormap`."""
    numbers = as_array(values, "values", (None,))
    start, end = as_number(low, "low", -1e300, 1e300), as_number(high, "high", -1e300, 1e300)
    if not start < end:
        raise OptionError(f"low must be below high, got {start:g} and {end:g}")
    return np.asarray(np.clip((numbers - start) / (end - start), 0.0, 1.0))


@dataclass(frozen=True)
class ColorScale:
    """Colour scale of a quantity, with the labels of its bar.

    Args:
        quantity: name of the quantity, plain ASCII.
        low, high: the range, low < high, in `unit`.
        unit: SI unit without a prefix, such as "Pa". The labels add a prefix.
    Raises: OptionError for an empty range or text that is not ASCII.
    """

    quantity: str
    low: float
    high: float
    unit: str

    def __post_init__(self) -> None:
        for name in ("quantity", "unit"):
            text = getattr(self, name)
            if not (isinstance(text, str) and text.isascii() and text.isprintable()):
                raise OptionError(f"{name} must be a line of plain ASCII, got {text!r}")
        self.colors([self.low])

    def colors(self, values: ArrayLike) -> NDArray[np.float32]:
        """Map numbers to colours from blue (`low`) through yellow to red (`high`).

        All colours are bright enough for shaded surfaces.

        Args:
            values: (n,), one per vertex; values out of range are clamped.
        Returns: sRGB from 0 to 1, float32 (n, 3).
        Raises: OptionError for values that are not finite.
        """
        place = _places(values, self.low, self.high) * (len(RAMP) - 1)
        channels = [np.interp(place, np.arange(len(RAMP)), column) for column in np.transpose(RAMP)]
        return np.stack(channels, axis=1).astype(np.float32)

    def ticks(self) -> tuple[str, str]:
        """Return the labels of the lower and the upper end of the bar, for example ("0", "200 kPa")."""
        largest = max(abs(self.low), abs(self.high))
        prefix, factor = next(each for each in PREFIXES if largest >= 10 * each[1] or each is PREFIXES[-1])
        return f"{self.low / factor:.4g}", f"{self.high / factor:.4g} {prefix}{self.unit}"


def highlight(flagged: ArrayLike, color: ArrayLike, marked: ArrayLike = FLIPPED) -> NDArray[np.float32]:
    """Return vertex colours that mark flagged vertices, for example those of inverted tetrahedra.

    Args:
        flagged: True for vertices to mark, (n,).
        color, marked: sRGB of vertices without and with a flag, (3,).
    Returns: sRGB from 0 to 1, float32 (n, 3).
    Raises: OptionError for wrong shapes or colours.
    """
    flags = to_array(flagged, "flagged")
    if flags.ndim != 1 or flags.dtype != np.bool_:
        raise OptionError(f"flagged must be bools of shape (n,), got {flags.dtype} of shape {flags.shape}")
    usual, special = as_color(color, "color"), as_color(marked, "marked")
    return np.where(flags[:, None], special, usual).astype(np.float32)


def to_linear(srgb: NDArray[np.float32]) -> NDArray[np.float32]:
    """Convert sRGB from 0 to 1 to linear light, in which colours can be added."""
    low = srgb <= 0.04045
    return np.where(low, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


def to_srgb(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Convert linear light from 0 to 1 to sRGB."""
    low = linear <= 0.0031308
    return np.where(low, linear * 12.92, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055).astype(
        np.float32
    )
