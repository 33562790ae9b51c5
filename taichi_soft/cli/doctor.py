"""Command `doctor`: check a mesh file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from taichi_soft.cli.console import Arch, AsJson, Threads, console, errors, say
from taichi_soft.core.runtime import init
from taichi_soft.elements.materials import preset

COLORS = {"good": "green", "note": "yellow", "bad": "bold red"}


def doctor(
    file: Annotated[Path, typer.Argument(help="A surface (.glb, .obj, .ply, .stl, .off), or tetrahedra.")],
    material: Annotated[
        str, typer.Option(help="Material preset; `taichi-soft info` lists all.")
    ] = "gelatine",
    cells: Annotated[
        int | None, typer.Option(help="Cells of the cage along the longest side; 10 by default.")
    ] = None,
    method: Annotated[str, typer.Option(help="Meshing method: lattice, ftetwild or tetgen.")] = "lattice",
    up: Annotated[
        str | None,
        typer.Option(help="Axis that points up in the file, y or z. By default that of its format."),
    ] = None,
    fix: Annotated[
        Path | None,
        typer.Option(help="Write a repaired surface here: without degenerate triangles, all outwards."),
    ] = None,
    as_json: AsJson = False,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Print the problems of a mesh and the cost of its body. Exit with 1 if the mesh cannot become a body."""
    from taichi_soft.doctor import diagnose
    from taichi_soft.doctor.mending import write_mended
    from taichi_soft.meshing.surfaces import read_surfaces

    made_of = preset(material)  # type: ignore[arg-type]
    init(arch, threads)
    with errors.status("making a body and timing its frames"):
        found = diagnose(file, made_of, cells=cells, method=method, up=up)  # type: ignore[arg-type]
    if as_json:
        print(json.dumps(found.as_plain(), indent=2))
    else:
        for each in found.findings:
            color = COLORS[each.grade.value]
            say(f"[{color}]{each.grade.value:4}[/] {escape(each.text)}")
        if found.figures:
            table = Table(show_header=False, box=None)
            for name, value in found.figures.items():
                table.add_row(escape(name), f"{value:,.4g}" if value < 1000 else f"{value:,.0f}")
            console.print(table)
    if fix is not None:
        left_out, turned = write_mended(read_surfaces(file, up), fix)  # type: ignore[arg-type]
        if not as_json:
            say(f"{escape(fix.name)}: {left_out:,} triangles removed, {turned:,} flipped")
    if not found.is_fit:
        raise typer.Exit(1)
