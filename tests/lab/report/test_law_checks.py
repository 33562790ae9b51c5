"""The table of all laws: numbers of the experiments, divided by their theoretical values."""

import pytest

from lab.experiments import EXPERIMENTS, Result, Results, Section
from lab.report.law_checks import law_table

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

NOTHING = Section((), ())


def concluded(name, *rows):
    return EXPERIMENTS[name], Results(tuple(Result(point, numbers) for point, numbers in rows)), NOTHING


def table_of(*sections):
    table = law_table(sections)
    return {row[0]: dict(zip(table.columns[1:], row[1:], strict=True)) for row in table.rows}


def test_without_a_check_there_is_no_table():
    assert law_table([]) is None
    assert law_table([concluded("fig-3.1")]) is None


def test_each_law_has_the_numbers_of_its_points():
    """At a depth of 5 mm, Hertz's force is 4/3 E / (1 - nu^2) sqrt(R) d^1.5 = 366.3 N.

    The wave speed is sqrt(E / rho).
    """
    rows = table_of(
        concluded(
            "patch-test",
            ({"law": "virial", "seed": 1}, {"surface": [1e-4, 1e-3]}),
            ({"law": "virial", "seed": 2}, {"surface": [3e-4, 1e-3]}),
            ({"law": "springs", "seed": 1}, {"surface": [1.3, 1.3]}),
        ),
        concluded(
            "hertz",
            ({"law": "virial", "pieces": 6, "plane": "floor"}, {"forces": [0.0, 366.3, 0.0]}),
            ({"law": "virial", "pieces": 8, "plane": "floor"}, {"forces": [0.0, 999.0, 0.0]}),
            ({"law": "finite elements", "pieces": 6, "plane": "floor"}, {"forces": [0.0, 732.6, 0.0]}),
        ),
        concluded("wave-speed", ({"law": "springs", "poisson": 0.3, "cells": 2}, {"speed": 15.811})),
    )
    patch, speed, force = rows["theory"]
    assert list(rows["theory"].values()) == [0.0, 1.0, 1.0]
    assert rows["virial"] == {patch: 3e-4, force: pytest.approx(1.0, abs=1e-3), speed: None}
    assert rows["springs"] == {patch: 1.3, force: None, speed: pytest.approx(0.5, abs=1e-3)}
    assert rows["linear finite elements"][force] == pytest.approx(2.0, abs=2e-3)
    assert list(rows) == ["theory", "linear finite elements", "virial", "springs"]


def test_of_a_body_that_broke_nothing_is_said():
    rows = table_of(
        concluded(
            "momentum-budget",
            ({"law": "cmpm", "damping": 0.0}, {"angular_momentum": -1.0}),
            ({"law": "virial", "damping": 0.0}, {"angular_momentum": 2e-7}),
        )
    )
    assert "cmpm" not in rows
    assert list(rows["virial"].values()) == [2e-7]
