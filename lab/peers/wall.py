"""Film the comparison: one panel per engine, with its cost and its error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lab.peers.comparison import Entry
from lab.peers.drop import Drop
from lab.peers.trajectory import Progress
from taichi_soft.core.checks import LARGEST_COUNT, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.render import PALETTE, Camera, Renderer, Surface, VideoWriter, draw_text

GAP = 4
"""Gap between panels [pixels]."""

DARK = 24
"""Grey value of gaps and empty panels, 0 to 255."""

REFERENCE_COLOR = (0.93, 0.92, 0.88)

MARK = (200, 30, 40)
"""RGB colour of the line at the top of the reference, 0 to 255."""


def film_wall(
    drop: Drop,
    entries: Sequence[Entry],
    writer: VideoWriter,
    *,
    seconds: float,
    on_frame: Progress | None = None,
) -> int:
    """Film trajectories side by side, and return the number of frames.

    Args:
        drop: the drop of the trajectories.
        entries: results of `compare`.
        writer: film to write to.
        seconds: length of the film. The whole drop is shown, in slow motion if the film is longer.
        on_frame: called with (frames made, total frames) after each frame.
    Raises: OptionError for a length out of range.
    """
    frames = as_positive(seconds, "seconds", "s") * writer.fps
    if frames > LARGEST_COUNT:
        raise OptionError(
            f"seconds is {seconds:g} at {writer.fps:g} per second: at most {LARGEST_COUNT:,} frames"
        )
    count = max(2, round(frames))
    wall = _Wall(drop, entries, writer.size, f", at {drop.seconds / seconds:.2g} x speed")
    for number in range(count):
        writer.write(wall.draw(drop.seconds * number / (count - 1)))
        if on_frame:
            on_frame(number + 1, count)
    return count


def draw_wall(drop: Drop, entries: Sequence[Entry], time: float, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Draw the frame of the film at a time of the drop [s]. Returns: sRGB, uint8 (height, width, 3)."""
    return _Wall(drop, entries, size, "").draw(time)


class _Wall:
    """Draws panels in rows of at most three. A line in each panel marks the top of the reference."""

    def __init__(self, drop: Drop, entries: Sequence[Entry], size: tuple[int, int], pace: str) -> None:
        self.entries, self.size, self.pace = entries, size, pace
        self.columns = min(len(entries), 2 if len(entries) == 4 else 3)
        rows = -(-len(entries) // self.columns)
        width = (size[0] - GAP * (self.columns - 1)) // self.columns
        height = (size[1] - GAP * (rows - 1)) // rows
        half = np.ptp(drop.mesh.vertices, axis=0) / 2
        top = float(drop.start[:, 2].max())
        camera = Camera.framing(
            (-1.2 * half[0], -half[1], -0.75 * top),
            (1.2 * half[0], half[1], 1.12 * top),
            azimuth=-90,
            elevation=8,
            aspect=width / height,
            margin=1.05,
        )
        self.renderer = Renderer(width, height, camera=camera, floor=0.0)
        self.surfaces = [
            Surface.of(drop.mesh, color=REFERENCE_COLOR if entry.is_reference else PALETTE[i % len(PALETTE)])
            for i, entry in enumerate(entries)
        ]

    def draw(self, time: float) -> NDArray[np.uint8]:
        """Draw the frame at a time of the drop [s]."""
        picture = np.full((self.size[1], self.size[0], 3), DARK, dtype=np.uint8)
        width, height = self.renderer.width, self.renderer.height
        for i, (entry, surface) in enumerate(zip(self.entries, self.surfaces, strict=True)):
            surface.positions = entry.trajectory.at(time)
            panel = self.renderer.render([surface])
            row = self._height_of_reference(time)
            panel[row : row + 2] = MARK
            draw_text(panel, captions(entry), corner="bottom left")
            if i == 0:
                draw_text(panel, [f"t = {time:.2f} s{self.pace}"], corner="top left")
            if entry.is_reference:
                draw_text(panel, ["the line: its top"], corner="top left")
            above, before = divmod(i, self.columns)
            top, left = above * (height + GAP), before * (width + GAP)
            picture[top : top + height, left : left + width] = panel
        return picture

    def _height_of_reference(self, time: float) -> int:
        """Return the row of pixels at the top of the reference."""
        reference = next(entry for entry in self.entries if entry.is_reference)
        top = [(0.0, 0.0, reference.trajectory.at(time)[:, 2].max())]
        row = self.renderer.camera.project(top, self.renderer.width, self.renderer.height)[0, 1]
        return int(np.clip(row, 0, self.renderer.height - 1))


def captions(entry: Entry) -> list[str]:
    """Return the lines of text below a body: its engine, cost and error."""
    squash = f"squashed by {entry.outcome.squash:.1%}"
    bounce = f"bounces back to {entry.outcome.bounce:.0%}"
    if entry.is_reference:
        return ["reference: fine steps in float64", squash, bounce]
    return [
        entry.name,
        f"{_milliseconds(entry.cost)} for a frame of 1/60 s",
        f"{squash}, {_in_words(entry.squash_error)}",
        f"{bounce}, {_in_words(entry.bounce_error)}",
    ]


def _milliseconds(time: float) -> str:
    """Format a time [s] in milliseconds, with at least two digits."""
    ms = time * 1e3
    return f"{ms:.{0 if ms >= 10 else 1 if ms >= 1 else 2}f} ms"


def _in_words(error: float) -> str:
    size = f"{abs(error):.0%}"
    return "as it should" if size == "0%" else f"{size} too {'much' if error > 0 else 'little'}"
