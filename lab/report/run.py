"""Choose experiments by name, measure their points, and draw conclusions."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from lab.experiments import (
    EXPERIMENTS,
    Effort,
    Experiment,
    Finding,
    Point,
    Result,
    Results,
    Section,
    Verdict,
    section_of,
)
from lab.report.judgements import Concluded
from lab.report.wording import legible
from lab.sweep import (
    TIME_LIMIT,
    Outcome,
    Store,
    Task,
    compute_all,
    origin,
    show_progress,
)
from taichi_soft.core.checks import choose_one_of
from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import ArchName


def choose_experiments(names: Sequence[str]) -> list[Experiment]:
    """Return the experiments with these names, or all experiments, in the order of the report.

    Raises: OptionError for an unknown name.
    """
    for name in names:
        if name not in EXPERIMENTS:
            raise OptionError(f"unknown experiment {name!r}: {choose_one_of(EXPERIMENTS, name)}")
    return [experiment for name, experiment in EXPERIMENTS.items() if name in names or not names]


def require_writable(folder: Path) -> None:
    """Create `folder` and check that files can be written into it. Raises: OptionError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OptionError(
            f"cannot write into {str(folder)!r} ({error.strerror or error}): choose another folder"
        ) from error


def run_experiments(
    experiments: Sequence[Experiment],
    effort: Effort,
    folder: Path,
    console: Console,
    *,
    workers: int | None = None,
    arch: ArchName = "cpu",
    time_limit: float = TIME_LIMIT,
) -> list[Concluded]:
    """Measure all points that `folder` does not contain yet, and draw conclusions.

    Each result is stored in `folder` immediately, so an interrupted report can resume. Failed points are
    retried.

    Args:
        console: console for progress and for errors of points.
        workers: number of processes; None for one per core.
        time_limit: time limit of a point [s].
    Raises: SweepError before anything is computed if a file cannot be used.
    """
    points = {experiment.name: experiment.points(effort) for experiment in experiments}
    with ExitStack() as stack:
        stores = {}
        for name in points:
            stores[name] = store = stack.enter_context(closing(Store(folder / f"{name}.jsonl", origin(arch))))
            if store.set_aside is not None:
                _note(console, f"{name}: results of other code were moved to {store.set_aside}")
        tasks = [
            Task(each.name, each.measure, point, each.is_timing)
            for each in experiments
            for point in points[each.name]
            if _outcome(stores[each.name], point).numbers is None
        ]
        total = sum(map(len, points.values()))
        known = f", {total - len(tasks)} of them measured before, in {folder}" if len(tasks) < total else ""
        _note(console, f"{total} points of {len(experiments)} experiments{known}")
        if tasks:
            outcomes = stack.enter_context(
                closing(compute_all(tasks, workers=workers, arch=arch, time_limit=time_limit))
            )
            try:
                _keep_all(outcomes, len(tasks), stores, console)
            except KeyboardInterrupt:
                _note(console, f"the results so far are in {folder}: run the same command to resume")
                raise
        return [_conclude(each, _results(points[each.name], stores[each.name])) for each in experiments]


def _keep_all(
    outcomes: Iterable[tuple[Task, Outcome]], count: int, stores: dict[str, Store], console: Console
) -> None:
    with show_progress(console, count) as advance:
        for task, outcome in outcomes:
            stores[task.group].keep(task.point, outcome)
            if outcome.numbers is None:
                _note(console, f"failed: {task.group} {task.point}: {outcome.error}")
            advance(task.group)


def _outcome(store: Store, point: Point) -> Outcome:
    return store.get(point) or Outcome(None, "not computed")


def _results(points: Sequence[Point], store: Store) -> Results:
    return Results(tuple(Result(point, **vars(_outcome(store, point))) for point in points))


def _conclude(experiment: Experiment, results: Results) -> Concluded:
    """Conclude an experiment.

    If this fails and points are missing, all verdicts of the experiment are "cannot be told".
    """
    try:
        return experiment, results, _legible(section_of(experiment, results))
    except Exception as error:
        if not results.failed:
            raise
        why = f"{len(results.failed)} of {len(results.rows)} points failed: {type(error).__name__}: {error}"
        findings = [Finding(claim, "not measured", Verdict.UNKNOWN, why) for claim in experiment.claims]
        return experiment, results, Section((), tuple(findings))


def _legible(section: Section) -> Section:
    return replace(
        section,
        text=tuple(map(legible, section.text)),
        findings=tuple(
            replace(each, measured=legible(each.measured), why=legible(each.why)) for each in section.findings
        ),
        plots=tuple(replace(each, caption=legible(each.caption)) for each in section.plots),
        pictures=tuple(replace(each, caption=legible(each.caption)) for each in section.pictures),
    )


def _note(console: Console, line: str) -> None:
    console.print(escape(line), soft_wrap=True, highlight=False)
