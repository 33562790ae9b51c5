"""Experiments that compute nothing, importable by worker processes."""

import os
from pathlib import Path

from lab.experiments import Effort, Experiment, Finding, Section, Table, Verdict


def points(effort):
    """List three points, or five for a full report."""
    return [{"x": x} for x in range(3 if effort is Effort.QUICK else 5)]


def measure(point):
    """Return the square of a number, and record in a file that the point was measured."""
    with open(os.environ["FAKES_LOG"], "a") as log:
        log.write(f"{point['x']} ")
    return {"square": point["x"] ** 2}


def measure_rough(point):
    """Measure like `measure`.

    While a file `rough` exists, point 1 raises an error and point 2 ends the process.
    """
    if Path(os.environ["FAKES_LOG"]).with_name("rough").exists():
        if point["x"] == 1:
            raise ValueError("too rough")
        if point["x"] == 2:
            os._exit(9)
    return measure(point)


def conclude(results):
    """Judge the square of 2, and list all squares in a table."""
    table = tuple((point["x"], numbers["square"]) for point, numbers in results.where())
    largest = results.one(x=2)["square"]
    finding = Finding("wave-speed", f"{largest}", Verdict.AGREES if largest == 4 else Verdict.DIFFERS)
    return Section(("Squares.",), (finding,), (Table("squares", "Squares", ("x [m]", "x^2 [m^2]"), table),))


def conclude_carelessly(results):
    """Fail with another error than MissingPointError if a point is missing."""
    return Section((str([numbers["square"] for _, numbers in results.where()][2]),), ())


def measure_nothing(point):
    """Raise an error."""
    raise ValueError("nothing to see")


SQUARES = Experiment("squares", "Squares", "theory", ("wave-speed",), points, measure, conclude)
ROUGH = Experiment("rough", "Rough squares", "theory", ("wave-speed",), points, measure_rough, conclude)
CARELESS = Experiment(
    "careless",
    "Squares",
    "theory",
    ("wave-speed",),
    points,
    measure_rough,
    conclude_carelessly,
    is_timing=True,
)
NOTHING = Experiment("nothing", "Nothing", "theory", ("hertz",), points, measure_nothing, conclude)
