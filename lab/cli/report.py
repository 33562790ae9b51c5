"""Command `python -m lab report`: run the thesis's experiments."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from lab.extras import require_report
from taichi_soft.cli.console import Arch, console, errors, say
from taichi_soft.core.runtime import init


def report(
    names: Annotated[list[str] | None, typer.Argument(help="Experiments; all of them by default.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the page; out/report by default. With names and no folder, print tables instead."
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A coarse answer to every claim, within minutes.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Processes; one per core by default.")
    ] = None,
    arch: Arch = "auto",
    show_list: Annotated[bool, typer.Option("--list", help="List the experiments and end.")] = False,
) -> None:
    """Run the thesis's experiments and judge its claims; exit code 1 if a point could not be computed.

    Each result is stored immediately, in the folder "data" next to the page. An interrupted report resumes
    from the stored results and retries failed points.
    """
    from lab.experiments import Effort
    from lab.report.machine import machine_facts
    from lab.report.run import choose_experiments, require_writable, run_experiments

    chosen = choose_experiments(names or [])
    if show_list:
        for each in chosen:
            say(f"[bold]{each.name:24}[/]{escape(f'{each.title} ({each.source})')}")
        return
    require_report()
    folder = out or Path("out") / "report"
    require_writable(folder)
    device = init(arch)
    if device.is_gpu and workers is None:
        workers = 1
    effort = Effort.QUICK if quick else Effort.FULL
    concluded = run_experiments(chosen, effort, folder / "data", errors, workers=workers, arch=device.arch)
    from lab.report.judgements import judge
    from lab.report.page import write_report
    from lab.report.terminal import print_section, print_verdicts

    if names and out is None:
        for experiment, results, section in concluded:
            print_section(console, experiment, results, section)
    else:
        command = [
            "python",
            "-m",
            "lab",
            "report",
            *(names or []),
            "--out",
            str(folder),
            *["--quick"] * quick,
        ]
        page = write_report(concluded, folder, shlex.join(command), effort, machine_facts(device.arch))
        print_verdicts(console, judge(concluded))
        say(f"wrote {escape(str(page))}")
    failed = sum(len(results.failed) for _, results, _ in concluded)
    if failed:
        say(f"{failed} points could not be computed. Run the same command to retry them.")
        raise typer.Exit(1)
