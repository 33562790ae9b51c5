"""The table of contact scenes, for the terminal and as a Markdown page."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from itertools import groupby

from rich.table import Table
from rich.text import Text

from lab.contact.run import Outcome


def terminal(outcomes: Sequence[Outcome]) -> Table:
    """Return the table for the terminal."""
    table = Table("scene", "criterion", "measured", "wanted", "", "step", box=None, pad_edge=False)
    for _, group in groupby(outcomes, lambda each: each.scene):
        for number, each in enumerate(group):
            mark = Text("holds", style="green") if each.is_met else Text("fails", style="red")
            scene, cost = (each.scene, f"{each.step_ms:.2g} ms") if number == 0 else ("", "")
            table.add_row(scene, each.criterion, each.measured, each.wanted, mark, cost)
    return table


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Return a Markdown page with the table, and the number of scenes that hold."""
    scenes = {each.scene: [o for o in outcomes if o.scene == each.scene] for each in outcomes}
    holding = sum(all(o.is_met for o in rows) for rows in scenes.values())
    now = datetime.now(timezone.utc).strftime("%Y-%m-%d")
    lines = [
        "# Scenes of contact",
        "",
        f"Made by `python -m lab contact` on {now}. {holding} of {len(scenes)} scenes meet all criteria.",
        "The last column has the median time of a step of 1/60 s.",
        "",
        "| scene | criterion | measured | wanted | | step |",
        "|---|---|---|---|---|---:|",
    ]
    for rows in scenes.values():
        for number, each in enumerate(rows):
            first = (f"**{each.scene}**: {each.title}", f"{each.step_ms:.2g} ms") if number == 0 else ("", "")
            mark = "holds" if each.is_met else "**fails**"
            lines.append(
                f"| {first[0]} | {each.criterion} | {each.measured} | {each.wanted} | {mark} | {first[1]} |"
            )
    return "\n".join(lines) + "\n"
