"""Command `info`: print the chosen device, and the available laws and materials."""

from __future__ import annotations

import json
import platform
from typing import Annotated, cast

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from taichi_soft.cli.console import Arch, AsJson, Threads, console, device_facts, errors, say, version_of
from taichi_soft.core.runtime import init
from taichi_soft.core.types import LawName
from taichi_soft.elements.materials import Material


def info(
    laws: Annotated[bool, typer.Option("--laws", help="Measure the cost of each force law.")] = False,
    law: Annotated[
        list[str] | None, typer.Option(help="Measure only this law; repeat the option for several.")
    ] = None,
    arch: Arch = "auto",
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Print the device, versions, laws and materials."""
    from taichi_soft.elements.laws import LAWS
    from taichi_soft.elements.materials import PRESETS
    from taichi_soft.profiling.baseline import find_compiler

    device = init(arch, threads)
    if laws or law:
        __say_laws(list(LAWS) if laws else law or [], as_json)
        return
    facts = {
        **device_facts(device),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "c++ compiler": find_compiler() or "none",
        **{name: version_of(name) for name in ("taichi-soft", "taichi", "numpy", "opencv-python-headless")},
        "law": {law.name: f"{law.summary} ({law.source})" for law in LAWS.values()},
        "material": {name: _material_line(material) for name, material in PRESETS.items()},
    }
    if as_json:
        print(json.dumps(facts, indent=2))
        return
    table = Table(show_header=False, box=None)
    for key, value in facts.items():
        rows = value.items() if isinstance(value, dict) else [("", value)]
        for name, text in rows:
            table.add_row(f"[bold]{key}[/] {name}", escape(str(text)))
    console.print(table)


def __say_laws(names: list[str], as_json: bool) -> None:
    from taichi_soft.profiling import measure_laws
    from taichi_soft.profiling.profile_tables import law_rows, law_table

    with errors.status("compiling and measuring laws"):
        costs = measure_laws(cast(list[LawName], names))  # also checks the names
    if as_json:
        print(json.dumps(law_rows(costs), indent=2))
        return
    say(escape("Median substep on one thread [ns per element], and over that of virial on the same body"))
    Console(width=max(console.width, 150)).print(law_table(costs))


def _material_line(material: Material) -> str:
    return (
        f"E = {material.young / 1e6:g} MPa, nu = {material.poisson:g}, {material.density:g} kg/m^3, "
        f"b = {material.damping:g} N s/m"
    )
