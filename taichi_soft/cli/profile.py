"""Command `profile`: measure the cost of a frame."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Annotated, Any, Literal, TypeAlias

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, AsJson, Threads, console, device_facts, errors, say
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init

GpuName: TypeAlias = Literal["cuda", "vulkan", "metal"]

IN_TURN = 15
"""Smallest number of steps in a measurement of a time budget."""


def profile(
    bodies: Annotated[int, typer.Option(min=1, max=4096, help="Spheres of 1,280 tetrahedra.")] = 16,
    baseline: Annotated[
        bool, typer.Option("--baseline", help="Compare with plain C++ on one thread.")
    ] = False,
    crossover: Annotated[
        bool, typer.Option("--crossover", help="Compare the schedules for bodies of increasing size.")
    ] = False,
    scaling: Annotated[
        bool, typer.Option("--scaling", help="Compare 64 spheres on one thread and on all.")
    ] = False,
    gpu: Annotated[
        GpuName | None, typer.Option(help="Compare the CPU's threads with this kind of GPU (minutes).")
    ] = None,
    implicit: Annotated[
        bool, typer.Option("--implicit", help="Compare implicit Euler with leapfrog and with scipy.")
    ] = False,
    startup: Annotated[
        bool, typer.Option("--startup", help="Time new processes until their worlds are warm (minutes).")
    ] = False,
    game: Annotated[
        bool, typer.Option("--game", help="Measure the cost of contact, sleep, spawning and unused features.")
    ] = False,
    budget: Annotated[
        bool, typer.Option("--budget", help="Measure whether levels of detail keep a time budget (minutes).")
    ] = False,
    repeats: Annotated[int, typer.Option(min=3, help="Number of measurements per figure.")] = 121,
    as_json: AsJson = False,
    arch: Arch = "auto",
    threads: Threads = None,
    cores: Annotated[
        str | None,
        typer.Option(help="Cores to bind the threads to, such as 0,1 (Linux); --threads alone binds none."),
    ] = None,
) -> None:
    """Measure the cost of a frame, and how many bodies fit a frame at 60 Hz and 120 Hz."""
    device = init(arch, threads, _cores_of(cores))
    from taichi_soft import profiling
    from taichi_soft.profiling import profile_tables

    library = profiling.compile_baseline() if baseline else None
    with errors.status("measuring frames") as status:
        found: dict[str, Any] = {"budget": profiling.measure_budget(bodies, repeats)}
        if library:
            status.update("measuring against C++")
            found["baseline"] = profiling.compare_with_baseline(library, max(3, repeats // 4))
        if crossover:
            status.update("measuring schedules")
            found["crossover"] = profiling.measure_crossover(max(3, repeats // 6))
        if scaling:
            status.update("measuring threads")
            found["scaling"] = profiling.measure_scaling(device.threads, device.cores, max(3, repeats // 3))
        if gpu:
            status.update("measuring a GPU")
            repeated = max(3, repeats // 12)
            found["devices"] = profiling.measure_devices(gpu, device.threads, device.cores, repeated)
        if implicit:
            status.update("measuring implicit steps")
            found["implicit"] = profiling.measure_implicit(max(3, repeats // 12))
        if startup:
            status.update("starting new processes")
            found["startup"] = profiling.measure_startup(device.arch, device.threads, device.cores)
        if game:
            status.update("measuring what a game does")
            found["features"] = profiling.measure_features(max(3, repeats // 3))
            found["heap"] = profiling.measure_heaps(device.threads, max(3, repeats // 2))
            found["moments"] = profiling.measure_moments(max(3, repeats // 2))
        if budget:
            status.update("measuring a budget")
            found["kept_budget"] = profiling.measure_kept_budget(max(IN_TURN, 5 * repeats))
    if as_json:
        rows = {key: [asdict(row) for row in value] for key, value in found.items()}
        print(json.dumps({"device": device_facts(device), **rows}, indent=2))
        return
    where = f", bound to cores {', '.join(map(str, device.cores))}" if device.cores else ""
    say(f"{device.arch}, {device.threads} threads ({device.reason}){where}")
    for title, table in profile_tables.tables(found):
        say(f"\n[bold]{escape(title)}[/]")  # the title of a Table would wrap at the table's width
        console.print(table)


def _cores_of(text: str | None) -> tuple[int, ...] | None:
    if text is None:
        return None
    numbers = text.split(",")
    if not all(number.strip().isdecimal() for number in numbers):
        raise OptionError(f"cores must be numbers of processor cores, such as 0,1, got {text!r}")
    return tuple(map(int, numbers))
