"""Plot of the stiffness of every law under several loads, divided by the expected stiffness."""

from __future__ import annotations

from typing import Any

MARKERS = "os^DvP"


def draw_stiffness_dots(
    figure: Any, rows: dict[str, dict[str, float]], expected: str, limits: tuple[float, float]
) -> None:
    """Draw one row per law with one mark per load, in an empty figure.

    Args:
        rows: ratio by load, for each law.
        expected: name of the stiffness that the ratios refer to, for the label of the axis.
        limits: limits of the axis; marks outside are drawn at its ends.
    """
    axes = figure.add_subplot()
    loads = list(dict.fromkeys(load for ratios in rows.values() for load in ratios))
    for number, load in enumerate(loads):
        held = [
            (min(max(ratios[load], limits[0]), limits[1]), row) for row, ratios in enumerate(rows.values())
        ]
        shift = 0.12 * (number - (len(loads) - 1) / 2)
        axes.plot(
            [ratio for ratio, _ in held],
            [row + shift for _, row in held],
            MARKERS[number % len(MARKERS)],
            markersize=5,
            label=load,
            clip_on=False,
        )
    axes.axvline(1.0, color="0.4", linewidth=1, zorder=0)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.invert_yaxis()
    axes.set_xlim(*limits)
    axes.grid(axis="y", color="0.9")
    axes.set_axisbelow(True)
    axes.set_xlabel(f"stiffness, over that of {expected} [1]")
    figure.legend(
        *axes.get_legend_handles_labels(), ncols=len(loads), loc="outside upper center", frameon=False
    )
