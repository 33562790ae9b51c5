"""Draw plots as PNG files in one style."""

from __future__ import annotations

import io
import warnings

from lab.experiments import Plot

SCALE = 2
"""Pixels of the file per pixel of the page (96 per inch), for high-resolution screens."""

COLOURS_OF_A_FILE = 128
"""Number of colours of a file, enough for anti-aliased lines and letters."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of Okabe and Ito, which colour-blind readers can distinguish. Yellow is omitted, because it is pale
on white."""

STYLE = {
    "font.size": 11,
    "axes.titlesize": 11,
    "axes.labelsize": 11,
    "legend.fontsize": 10,
    "xtick.labelsize": 10,
    "ytick.labelsize": 10,
    "lines.linewidth": 1.8,
    "lines.markersize": 5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.linewidth": 0.8,
    "axes.edgecolor": "#555555",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.limits": (-3, 5),
    "axes.formatter.use_mathtext": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.8,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "figure.facecolor": "white",
    "image.cmap": "viridis",
}


def png_of(plot: Plot) -> tuple[bytes, tuple[int, int]]:
    """Draw a plot. Returns: the PNG file, and its size on the page [pixels].

    Raises: MissingPointError if a point that the plot needs is missing.
    """
    import matplotlib
    from cycler import cycler
    from matplotlib.figure import Figure

    cycle = cycler(linestyle=("-", "--", ":")) * cycler(color=COLOURS)  # the eighth line is dashed
    width, height = (round(96 * inches) for inches in plot.size)
    with (
        matplotlib.rc_context({**STYLE, "axes.prop_cycle": cycle}),
        warnings.catch_warnings(),
    ):
        warnings.filterwarnings("ignore", "The figure layout has changed to tight")  # expected
        figure = Figure(figsize=(width / 96, height / 96), dpi=96 * SCALE, layout="constrained")
        plot.draw(figure)
        for axes in figure.axes:
            if axes.images or any(type(artist).__name__ == "QuadMesh" for artist in axes.collections):
                axes.grid(False)  # a grid would cover the map
        if any(axes.get_aspect() != "auto" for axes in figure.axes):
            for _ in range(2):  # the layout of axes with a fixed aspect needs two passes
                figure.draw_without_rendering()
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=96 * SCALE)
    return _with_palette(file), (width, height)


def _with_palette(file: io.BytesIO) -> bytes:
    """Convert a PNG image to a palette, which reduces the file to a third of its size."""
    from PIL import Image  # a dependency of matplotlib

    smaller = io.BytesIO()
    with Image.open(file) as image:
        flat = image.convert("RGB").quantize(COLOURS_OF_A_FILE, dither=Image.Dither.NONE)
        flat.save(smaller, "PNG", optimize=True)
    return smaller.getvalue()
