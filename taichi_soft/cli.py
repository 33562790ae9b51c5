"""The command line: demos, what was chosen on this machine, profiles, and the thesis's experiments."""

from __future__ import annotations

import json
import platform
import shlex
import sys
import warnings
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from taichi_soft.core.errors import OptionError, TaichiSoftError
from taichi_soft.core.runtime import Device, init
from taichi_soft.core.signals import INTERRUPTED, ended_by_signals
from taichi_soft.elements.materials import Material

app = typer.Typer(
    help="Real-time soft bodies from real material parameters.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
console = Console()
errors = Console(stderr=True)

Arch = Annotated[str, typer.Option(help="Device: auto (the CPU), cpu; untried: cuda, vulkan, metal.")]
Threads = Annotated[
    int | None, typer.Option(help="CPU threads; by default one per core, bound to it on Linux.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]


def main(*arguments: str) -> None:
    """Run the command line; an error of ours is one line and exit code 1, a wrong option 2.

    Args:
        arguments: to run with; without any, those of the process.
    """
    warnings.showwarning = _show_warning  # type: ignore[assignment]
    try:
        with ended_by_signals():
            app(arguments or None)
    except TaichiSoftError as error:
        errors.print(f"[bold red]error:[/] {escape(str(error))}", soft_wrap=True, highlight=False)
        sys.exit(1)
    except (KeyboardInterrupt, SystemExit) as end:
        if isinstance(end, SystemExit) and end.code != INTERRUPTED:
            raise
        errors.print("interrupted")
        sys.exit(INTERRUPTED)


def _show_version(asked: bool) -> None:
    if asked:
        _say(f"taichi-soft {_version_of('taichi-soft')}")
        raise typer.Exit


def _show_warning(message: Warning | str, category: type[Warning], *_: Any) -> None:
    errors.print(f"[yellow]{category.__name__}:[/] {escape(str(message))}", soft_wrap=True, highlight=False)


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show_version, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def demo(
    name: Annotated[str | None, typer.Argument(help="Which demo; without a name, lists them.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Film to write: .mp4, .webm, .gif, or .png for pictures.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Length of the film [s].")] = None,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 50.0,
    size: Annotated[str, typer.Option(help="Width x height in pixels.")] = "1280x720",
    video: Annotated[bool, typer.Option(help="Write a film, or only run and time the steps.")] = True,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Run a demo without a display, film it, and say how much faster than real time it ran."""
    from taichi_soft.render.stages import demo_names, load_demo

    if name is None:
        for each in demo_names():
            summary = (load_demo(each).__doc__ or "").strip().splitlines()[0]
            _say(f"[bold]{each:12}[/]{escape(summary)}")
        return
    pixels = _size_of(size)
    module = load_demo(name)
    path = (out or Path("out") / f"{name}.mp4") if video else None
    init(arch, threads)
    from taichi_soft.render.film import film

    stage = module.stage()
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=errors, disable=not errors.is_terminal) as progress:
        task = progress.add_task(name)
        report = film(
            stage,
            path,
            fps=fps,
            size=pixels,
            seconds=seconds,
            on_frame=lambda done, total: progress.update(task, completed=done, total=total),
        )
    if report.path is not None:
        _say(f"wrote {escape(str(report.path))}: {report.frames} frames, {report.frames / fps:.1f} s")
    if len(report.step_times):
        frame = f"median {median(report.step_times) * 1e3:.2f} ms per frame of {1e3 / fps:.1f} ms"
        _say(
            f"{name}: {report.simulated:.2f} s simulated, {frame}: "
            f"{report.real_time_factor:.1f} x faster than real time"
        )
    if len(report.draw_times):
        _say(f"a picture of {size} took {median(report.draw_times) * 1e3:.1f} ms to draw, at the median")


def _say(line: str) -> None:
    """Print one line as one line, however narrow the terminal is."""
    console.print(line, soft_wrap=True, highlight=False)


def _size_of(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise OptionError(f"size must be width x height in pixels, such as 1280x720, got {text!r}")
    return int(width), int(height)


def _cores_of(text: str | None) -> tuple[int, ...] | None:
    if text is None:
        return None
    numbers = text.split(",")
    if not all(number.strip().isdecimal() for number in numbers):
        raise OptionError(f"cores must be numbers of processor cores, such as 0,1, got {text!r}")
    return tuple(map(int, numbers))


@app.command()
def info(
    laws: Annotated[bool, typer.Option("--laws", help="Measure what each force law costs.")] = False,
    law: Annotated[list[str] | None, typer.Option(help="Measure this one; once for each of several.")] = None,
    arch: Arch = "auto",
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Say which device, versions, laws and materials there are."""
    from taichi_soft.elements.laws import LAWS
    from taichi_soft.elements.materials import PRESETS
    from taichi_soft.lab.profiling.baseline import find_compiler

    device = init(arch, threads)
    if laws or law:
        _say_laws(list(LAWS) if laws else law or [], as_json)
        return
    facts = {
        **_device_facts(device),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "c++ compiler": find_compiler() or "none",
        **{name: _version_of(name) for name in ("taichi-soft", "taichi", "numpy", "opencv-python-headless")},
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


def _say_laws(names: list[str], as_json: bool) -> None:
    from taichi_soft.lab.profiling import measure_laws
    from taichi_soft.lab.profiling.report import law_rows, law_table

    with errors.status("compiling and measuring laws"):
        costs = measure_laws(names)
    if as_json:
        print(json.dumps(law_rows(costs), indent=2))
        return
    _say(escape("Median substep on one thread [ns per element], and over that of virial on the same body"))
    Console(width=max(console.width, 150)).print(law_table(costs))


def _material_line(material: Material) -> str:
    return (
        f"E = {material.young / 1e6:g} MPa, nu = {material.poisson:g}, {material.density:g} kg/m^3, "
        f"b = {material.damping:g} N s/m"
    )


def _device_facts(device: Device) -> dict[str, Any]:
    facts = {"device": device.arch, "threads": device.threads, "chosen because": device.reason}
    return {**facts, "bound to cores": list(device.cores)} if device.cores else facts


def _version_of(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="A recording, see World(record=...).")],
    out: Annotated[
        Path | None, typer.Option(help="Picture of the end, .png; beside the recording by default.")
    ] = None,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Make a recording again, bit by bit; say what broke first, and draw the moment."""
    init(arch, threads)
    from taichi_soft.render.replay import failure_line
    from taichi_soft.render.replay import replay as play_again

    report = play_again(file, out or file.with_suffix(".png"))
    end = f"up to step {report.world.step_count}, t = {report.world.time:.4g} s"
    if report.first_difference is None:
        _say(f"{report.steps} steps made again, {end}: every state is the same, bit by bit")
    else:
        _say(
            f"{report.steps} steps made again, {end}: not the same from step {report.first_difference} on. "
            "Was it recorded on another kind of machine?"
        )
    for failure in report.failures:
        _say(failure_line(failure))
    if not report.failures:
        _say("no body is frozen")
    _say(f"wrote {escape(str(report.picture))}")
    if report.first_difference is not None:
        raise typer.Exit(1)


@app.command()
def profile(
    bodies: Annotated[int, typer.Option(min=1, max=4096, help="Spheres of 1,280 tetrahedra.")] = 16,
    baseline: Annotated[
        bool, typer.Option("--baseline", help="Compare with plain C++ on one thread.")
    ] = False,
    crossover: Annotated[
        bool, typer.Option("--crossover", help="Compare the schedules on one body of growing size.")
    ] = False,
    scaling: Annotated[
        bool, typer.Option("--scaling", help="Compare 64 spheres on one thread and on all.")
    ] = False,
    implicit: Annotated[
        bool, typer.Option("--implicit", help="Compare implicit Euler with leapfrog and with scipy.")
    ] = False,
    startup: Annotated[
        bool, typer.Option("--startup", help="Time a new process to its first frame, cold and warm.")
    ] = False,
    game: Annotated[
        bool, typer.Option("--game", help="What contact, sleep, spawning and unused features cost.")
    ] = False,
    repeats: Annotated[int, typer.Option(min=3, help="Measurements of each figure.")] = 121,
    as_json: AsJson = False,
    arch: Arch = "auto",
    threads: Threads = None,
    cores: Annotated[
        str | None,
        typer.Option(help="Cores to bind a thread each to, as 0,1 (Linux); --threads alone binds none."),
    ] = None,
) -> None:
    """Measure what a frame costs and how many bodies fit one of 60 Hz and of 120 Hz."""
    device = init(arch, threads, _cores_of(cores))
    from taichi_soft.lab import profiling
    from taichi_soft.lab.profiling import report

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
        if implicit:
            status.update("measuring implicit steps")
            found["implicit"] = profiling.measure_implicit(max(3, repeats // 12))
        if startup:
            status.update("starting new processes")
            found["startup"] = [profiling.measure_startup(device.arch, device.threads, device.cores)]
        if game:
            status.update("measuring what a game does")
            found["features"] = profiling.measure_features(max(3, repeats // 3))
            found["heap"] = profiling.measure_heaps(device.threads, max(3, repeats // 2))
            found["moments"] = profiling.measure_moments(max(3, repeats // 2))
    if as_json:
        rows = {key: [asdict(row) for row in value] for key, value in found.items()}
        print(json.dumps({"device": _device_facts(device), **rows}, indent=2))
        return
    where = f", bound to cores {', '.join(map(str, device.cores))}" if device.cores else ""
    _say(f"{device.arch}, {device.threads} threads ({device.reason}){where}")
    for title, table in report.tables(found):
        _say(f"\n[bold]{escape(title)}[/]")  # not the table's own title, which breaks at the table's width
        console.print(table)


@app.command()
def drop_test(
    cases: Annotated[
        int | None,
        typer.Option(
            min=1, max=100_000, help="How many random cases, 1000 by default; of a sweep, of each group."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all random numbers.")] = 0,
    first: Annotated[int, typer.Option(min=0, help="Number of the first case: repeats it alone.")] = 0,
    law: Annotated[
        str | None,
        typer.Option(help="Force law, virial by default; of a sweep, or default, and all if left out."),
    ] = None,
    flips: Annotated[
        str | None, typer.Option(help="tolerant, recover or off; recover by default, where the law takes it.")
    ] = None,
    worst: Annotated[int, typer.Option(min=0, help="Failed cases to list of each kind; a page has all.")] = 5,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="Instead, drop or wreck one body at a time, by every law.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Group of a sweep: foreign, own, cells or wrecked; may be repeated."),
    ] = None,
    damping: Annotated[str | None, typer.Option(help="Damping of a sweep, by name; all if left out.")] = None,
    wrecks: Annotated[int, typer.Option(min=0, max=100_000, help="Random wrecks to add to a sweep.")] = 0,
    out: Annotated[
        Path, typer.Option(help="Markdown page of a sweep; its results are kept in out/sweep.")
    ] = Path("out/sweep/sweep.md"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Processes of a sweep; one per core by default.")
    ] = None,
    as_json: AsJson = False,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Drop random bodies onto random courses and count what breaks; exit code 1 where anything did.

    With --sweep: bodies of many meshes and materials onto a floor, and wrecked ones, each as a game gets it
    by default and by every law. What was interrupted goes on from there.
    """
    if not sweep and (only or damping or wrecks or workers):
        raise OptionError("--only, --damping, --wrecks and --workers belong to a sweep: add --sweep")
    if sweep:
        if seed or first or threads:
            raise OptionError("--seed, --first and --threads belong to random cases: leave out --sweep")
        asked = {"law": law, "flips": flips, "damping": damping, "count": cases, "wrecks": wrecks}
        _sweep(asked, only, out, worst, workers, arch, as_json=as_json)
        return
    init(arch, threads)
    from taichi_soft.lab.drop_test import Summary, make_case, run_cases

    cases, law = cases or 1000, law or "virial"
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=errors, disable=not errors.is_terminal) as progress:
        numbers = range(first, first + cases)
        chosen = [make_case(seed, n, law, flips) for n in progress.track(numbers, description="making")]
        outcomes = []
        for outcome in progress.track(run_cases(chosen), total=cases, description="dropping"):
            outcomes.append(outcome)
            if not errors.is_terminal and len(outcomes) % 50 == 0:
                errors.print(f"{len(outcomes)} of {cases} cases")
    summary = Summary(tuple(outcomes))
    if as_json:
        print(json.dumps(summary.rows(), indent=2))
    else:
        for line in summary.lines(worst):
            _say(escape(line))
    if summary.failed:
        raise typer.Exit(1)


def _sweep(
    asked: dict[str, Any],
    groups: list[str] | None,
    out: Path,
    worst: int,
    workers: int | None,
    arch: str,
    *,
    as_json: bool,
) -> None:
    from taichi_soft.lab.drop_test.robustness import choose_cells
    from taichi_soft.lab.report import robustness
    from taichi_soft.lab.report.run import require_writable

    cells = choose_cells(groups or None, **asked)
    require_writable(out.parent)
    device = init(arch)
    rows = robustness.run_sweep(cells, Path("out") / "sweep", errors, workers=workers, arch=device.arch)
    robustness.write_page(rows, out, shlex.join(["taichi-soft", *sys.argv[1:]]), device.arch)
    if as_json:
        print(json.dumps([{**row.point, **(row.numbers or {"reason": row.error})} for row in rows], indent=2))
    else:
        robustness.print_sweep(console, rows, worst)
        _say(f"wrote {escape(str(out))}")
    if any(robustness.is_broken(row) for row in rows):
        raise typer.Exit(1)


@app.command()
def report(
    names: Annotated[list[str] | None, typer.Argument(help="Experiments; all of them by default.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write the page into; out/report by default. With names and no folder, tables are "
            "printed instead."
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A coarse answer to every claim, within minutes.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Processes; one per core by default.")
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            help="Address of a Dask scheduler, host:port, whose workers compute instead. Dask sends Python "
            "objects by pickle both ways: whoever reaches that port can run code on its workers and on this "
            "machine, so name a scheduler that you trust, in a network that you trust."
        ),
    ] = None,
    arch: Arch = "auto",
    show_list: Annotated[
        bool, typer.Option("--list", help="List the experiments, and compute nothing.")
    ] = False,
) -> None:
    """Run the thesis's experiments and judge its claims; exit code 1 where a point could not be computed.

    Every number is kept at once, in the folder data beside the page. What was interrupted goes on from there,
    and points that failed are computed again; without that folder everything is.
    """
    from taichi_soft.lab.experiments import Effort
    from taichi_soft.lab.report.extra import require_extra
    from taichi_soft.lab.report.machine import machine_facts
    from taichi_soft.lab.report.run import choose_experiments, require_writable, run_experiments

    chosen = choose_experiments(names or [])
    if show_list:
        for each in chosen:
            _say(f"[bold]{each.name:24}[/]{escape(f'{each.title} ({each.source})')}")
        return
    if cluster is not None and workers is not None:
        raise OptionError(
            f"--workers {workers} are of this machine, and --cluster {cluster} has its own: leave out one"
        )
    require_extra()
    folder = out or Path("out") / "report"
    require_writable(folder)
    device = init(arch)
    if device.is_gpu and workers is None:
        workers = 1
    effort = Effort.QUICK if quick else Effort.FULL
    concluded = run_experiments(
        chosen, effort, folder / "data", errors, workers=workers, cluster=cluster, arch=device.arch
    )
    from taichi_soft.lab.report.judgements import judge
    from taichi_soft.lab.report.page import write_report
    from taichi_soft.lab.report.terminal import print_section, print_verdicts

    if names and out is None:
        for experiment, results, section in concluded:
            print_section(console, experiment, results, section)
    else:
        command = ["taichi-soft", "report", *(names or []), "--out", str(folder), *["--quick"] * quick]
        facts = machine_facts(device.arch, f"Dask, {cluster}" if cluster else "processes of this machine")
        page = write_report(concluded, folder, shlex.join(command), effort, facts)
        print_verdicts(console, judge(concluded))
        _say(f"wrote {escape(str(page))}")
    failed = sum(len(results.failed) for _, results, _ in concluded)
    if failed:
        _say(f"{failed} points could not be computed: the same command tries them again")
        raise typer.Exit(1)
