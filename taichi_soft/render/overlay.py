"""Draw text on images: panels in corners, legends, colour bars and captions below bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import to_array
from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import Choice
from taichi_soft.render.arguments import as_color
from taichi_soft.render.colors import Color, ColorScale
from taichi_soft.render.opencv import cv2

Picture = NDArray[np.uint8]

FONT = cv2.FONT_HERSHEY_SIMPLEX
LINE = 1 / 26  # height of a line of text, as a fraction of the shorter side of the image
CAPTION = 0.8  # line height of captions, as a fraction of `LINE`; an image can have many captions
SMALLEST_LINE = 13.0  # smallest height of a line [pixels]; smaller letters are illegible
LETTER = 22.0  # height of a line of this font at scale 1 [pixels]
GAP = 0.45  # space between lines and around the text [line heights]
INDENT = " " * 5  # space for a colour swatch before a line
BAR = 12  # number of blanks between the labels of a colour bar
PANEL, OPACITY, INK = (22, 26, 34), 0.70, (245, 247, 250)


class Corner(Choice):
    """Corner of the image for a panel."""

    TOP_LEFT = "top left"
    TOP_RIGHT = "top right"
    BOTTOM_LEFT = "bottom left"
    BOTTOM_RIGHT = "bottom right"


def draw_text(picture: Picture, lines: Sequence[str], *, corner: Corner | str = Corner.TOP_LEFT) -> Picture:
    """Draw lines of text on a dark panel in a corner. The image is changed in place and returned.

    The font scales with the image and shrinks until all lines fit.
    Args:
        picture: uint8 (height, width, 3).
        lines: plain ASCII text; an empty list draws nothing.
        corner: "top left", "top right", "bottom left" or "bottom right".
    Raises: OptionError for an invalid image, text or corner.
    """
    _check(picture, lines)
    place = Corner.parse(corner)
    if lines:
        _draw_in_corner(picture, lines, place)
    return picture


def draw_legend(
    picture: Picture, entries: Sequence[tuple[Color, str]], *, corner: Corner | str = Corner.TOP_RIGHT
) -> Picture:
    """Draw lines of text like `draw_text`, each with a colour swatch in front. Returns: the image.

    Args:
        picture: uint8 (height, width, 3), changed in place.
        entries: pairs of sRGB from 0 to 1 and plain ASCII text.
        corner: "top left", "top right", "bottom left" or "bottom right".
    Raises: OptionError for an invalid image, colour, text or corner.
    """
    colors = [as_color(color, "color of the legend") for color, _ in entries]
    lines = [INDENT + text for _, text in entries]
    _check(picture, lines)
    place = Corner.parse(corner)
    if lines:
        left, top, line, pad = _draw_in_corner(picture, lines, place)
        side = round(0.85 * line)
        for row, color in enumerate(colors):
            begin = round(top + pad + row * line * (1.0 + GAP) + 0.12 * line)
            swatch = picture[begin : begin + side, left + pad : left + pad + side]
            swatch[:] = np.round(255.0 * np.array(color)).astype(np.uint8)
    return picture


def draw_color_scale(
    picture: Picture, scale: ColorScale, *, corner: Corner | str = Corner.TOP_RIGHT
) -> Picture:
    """Draw a colour bar with the quantity and the range of a scale. Returns: the image.

    Args:
        picture: uint8 (height, width, 3), changed in place.
        scale: scale to show.
        corner: "top left", "top right", "bottom left" or "bottom right".
    Raises: OptionError for an invalid image, scale or corner.
    """
    if not isinstance(scale, ColorScale):
        raise OptionError(f"scale must be a ColorScale, got {type(scale).__name__}")
    low, high = scale.ticks()
    _check(picture, [scale.quantity])
    place = Corner.parse(corner)
    ends = low + " " * BAR + high
    left, top, line, pad = _draw_in_corner(picture, [scale.quantity, "", low], place, ends)
    wide = max(_width(text, line) for text in (scale.quantity, ends))
    _put(picture, high, left + pad + wide - _width(high, line), _baseline(top + pad, 2, line), line)
    begin = round(top + pad + line * (1.0 + GAP))
    bar = picture[begin : begin + round(0.9 * line), left + pad : left + pad + wide]
    values = np.linspace(scale.low, scale.high, bar.shape[1])
    bar[:] = np.round(255.0 * scale.colors(values)).astype(np.uint8)
    return picture


def draw_labels(picture: Picture, labels: Sequence[str], places: ArrayLike) -> Picture:
    """Draw a caption centred below each place. The image is changed in place and returned.

    Args:
        picture: uint8 (height, width, 3).
        labels: n captions of plain ASCII text; a line break starts a second line.
        places: (n, 2) or more columns, pixels from the left and the top, see `Camera.project`. Captions are
            moved to stay inside the image; a place that is NaN (behind the camera) gets no caption.
    Raises: OptionError for an invalid image, text or number of places.
    """
    captions = [str(label).split("\n") for label in labels]
    _check(picture, [line for lines in captions for line in lines])
    pixels = to_array(places, "places")
    if pixels.dtype.kind not in "fiu" or pixels.shape[:1] != (len(labels),) or pixels.shape[1:] < (2,):
        raise OptionError(f"places must have shape ({len(labels)}, 2), got {pixels.shape}")
    height, width = picture.shape[:2]
    for lines, (u, v) in zip(captions, pixels[:, :2], strict=True):
        if not (np.isfinite(u) and np.isfinite(v)):
            continue
        line = _line_height(lines, width, height, CAPTION * min(height, width))
        pad, wide, high = _panel_size(lines, line)
        left = int(np.clip(u - wide / 2, 0, width - wide))
        top = int(np.clip(v + pad, 0, height - high))
        _draw_panel(picture, lines, left, top, line, pad, wide, high)
    return picture


def _check(picture: Picture, lines: Sequence[str]) -> None:
    if (
        not isinstance(picture, np.ndarray)
        or picture.dtype != np.uint8
        or picture.shape[2:] != (3,)
        or picture.size == 0
        or not picture.flags.writeable
    ):
        raise OptionError("picture must be uint8 of shape (height, width, 3), writeable and not empty")
    if not isinstance(lines, (list, tuple)):
        raise OptionError(f"text must be a list of lines of plain ASCII, got {lines!r}")
    for line in lines:
        if not (isinstance(line, str) and line.isascii() and line.isprintable()):
            raise OptionError(f"text must be a list of lines of plain ASCII, got {line!r}")


def _draw_in_corner(
    picture: Picture, lines: Sequence[str], corner: Corner, widest: str = ""
) -> tuple[int, int, float, int]:
    """Draw a panel in a corner, wide enough for the line `widest`.

    Returns: left and top of the panel, height of its lines, and its padding [pixels].
    """
    height, width = picture.shape[:2]
    margin = round(0.02 * min(height, width))
    sized = [*lines[:-1], max(lines[-1], widest, key=len)]
    line = _line_height(sized, width - 2 * margin, height - 2 * margin, min(height, width))
    pad, wide, high = _panel_size(sized, line)
    left = margin if "left" in corner.value else width - margin - wide
    top = margin if "top" in corner.value else height - margin - high
    _draw_panel(picture, lines, left, top, line, pad, wide, high)
    return left, top, line, pad


def _width(text: str, line: float) -> int:
    (width, _), _ = cv2.getTextSize(text, FONT, line / LETTER, _stroke(line))
    return int(width)


def _stroke(line: float) -> int:
    return max(1, round(line / 18.0))


def _line_height(lines: Sequence[str], width: int, height: int, side: float) -> float:
    """Return the largest line height up to the default at which all lines fit [pixels]."""
    line = max(LINE * side, SMALLEST_LINE)
    while line > 2.0:
        _, wide, high = _panel_size(lines, line)
        if wide <= width and high <= height:
            break
        line *= 0.93
    return line


def _panel_size(lines: Sequence[str], line: float) -> tuple[int, int, int]:
    """Return padding, width and height of a panel [pixels]."""
    pad = round(GAP * line) + 1
    wide = max(_width(text, line) for text in lines) + 2 * pad
    return pad, wide, round(len(lines) * line + (len(lines) - 1) * GAP * line) + 2 * pad


def _draw_panel(
    picture: Picture, lines: Sequence[str], left: int, top: int, line: float, pad: int, wide: int, high: int
) -> None:
    part = picture[top : top + high, left : left + wide]
    part[:] = np.round(part * (1.0 - OPACITY) + np.array(PANEL) * OPACITY).astype(np.uint8)
    canvas = np.ascontiguousarray(part)
    for row, text in enumerate(lines):
        _put(canvas, text, pad, _baseline(pad, row, line), line)
    part[:] = canvas


def _baseline(top: int, row: int, line: float) -> int:
    """Return the baseline of line `row` below `top` [pixels]."""
    return round(top + row * line * (1.0 + GAP) + 0.86 * line)


def _put(canvas: Picture, text: str, left: int, base: int, line: float) -> None:
    cv2.putText(canvas, text, (left, base), FONT, line / LETTER, INK, _stroke(line), cv2.LINE_AA)
