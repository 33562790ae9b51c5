"""Cells of the sweep: all combinations of body, law and damping. A cell is plain data."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np

from lab.drop_test.case import MOST_SAG, edge_damping
from lab.drop_test.robustness.foreign_meshes import FOREIGN_MESHES
from lab.drop_test.robustness.own_meshes import OWN_MESHES
from lab.drop_test.robustness.wrecks import WRECKS
from taichi_soft import TetMesh
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import FlipsName, LawName
from taichi_soft.elements.laws import LAWS, EnergyLaw, StressLaw

Cell = dict[str, Any]
"""A cell has the keys group, name, mesh, scale, young, poisson, density, dt, wreck, seed, law, flips and
damping. `wreck` is a name in `WRECKS`, or None for a drop. `law` and `flips` are None for the defaults.
`damping` is a name in `DAMPINGS`."""

MESHES: dict[str, Callable[[], TetMesh]] = {**OWN_MESHES, **FOREIGN_MESHES}

USUAL: Cell = {
    "scale": 1.0,
    "young": 1e6,
    "poisson": 0.3,
    "density": 1000.0,
    "dt": 1 / 60,
    "wreck": None,
    "seed": 0,
}
"""Default values of a cell."""

AXES: dict[str, tuple[float, ...]] = {
    "young": (1e4, 1e5, 1e6, 1e7, 1e8, 1e9),
    "poisson": (0.0, 0.3, 0.45, 0.49),
    "density": (10.0, 100.0, 1000.0, 10_000.0),
    "scale": (0.01, 0.1, 1.0, 10.0),
    "dt": (1 / 30, 1 / 60, 1 / 120),
}
"""Values that the group `cells` combines. The meshes of this group are about 1 m wide at scale 1."""

CELL_COUNT = 153
CELL_MESHES = ("sphere 4", "beam 3", "cylinder 3", "torus 2")

DAMPINGS: dict[str, Callable[[TetMesh, Cell], dict[str, float]]] = {
    "default": lambda mesh, cell: {},
    "none": lambda mesh, cell: {"damping_ratio": 0.0},
    "edges 0.2": lambda mesh, cell: {
        "damping": edge_damping(mesh, cell["young"], cell["density"], 0.2),
        "damping_ratio": 0.0,
    },
}
"""Functions that return the damping arguments of `Material`, by name."""

WRECKED_MESHES = ("box 2", "box 4", "slab 2", "sphere 2", "sphere 4")
WRECKED_SEEDS = range(3)


def law_variants() -> list[tuple[str | None, str | None]]:
    """Return pairs of law and flips. The first pair, (None, None), stands for the defaults.

    The other pairs combine each law on tetrahedra with each treatment of flips that the law supports.
    """
    laws = [law for law in LAWS.values() if isinstance(law, StressLaw | EnergyLaw)]
    return [(None, None), *((law.name, flips.value) for law in laws for flips in law.flips)]


def choose_cells(
    groups: list[str] | None = None,
    *,
    law: LawName | None = None,
    flips: FlipsName | None = None,
    damping: str | None = None,
    count: int | None = None,
    wrecks: int = 0,
) -> list[Cell]:
    """Choose cells by group, law and damping.

    Args:
        groups: names in `GROUPS`; None for all groups.
        law: name of a law, or "default" for the default law and flips; None for all laws.
        flips: treatment of inverted tetrahedra; None for all treatments that each law supports.
        damping: a name in `DAMPINGS`. None chooses "default" for the default law, and all dampings for the
            other laws.
        count: size of a random sample of each group; None for all cells. A larger sample contains all smaller
            samples.
        wrecks: number of random deformed bodies to add if `groups` is None or contains "wrecked".
    Raises: OptionError for unknown names.
    """
    for name in groups or []:
        _require_known("--only", name, GROUPS)
    if damping is not None:
        _require_known("--damping", damping, DAMPINGS)
    variants = [
        (each, treatment)
        for each, treatment in law_variants()
        if law in (None, each or "default") and (flips is None or flips == treatment)
    ]
    if not variants:
        known = ", ".join(f"{each} {treatment}" for each, treatment in law_variants()[1:])
        raise OptionError(f"no law {law!r} with flips {flips!r}: choose 'default' or one of {known}")
    found = []
    for name, make in GROUPS.items():
        if groups is None or name in groups:
            bodies = list(make())
            found += bodies if count is None else [bodies[k] for k in _sample(len(bodies), count)]
    if wrecks and (groups is None or "wrecked" in groups):
        found += [random_wreck(number) for number in range(wrecks)]
    return [
        {**body, "law": each, "flips": treatment, "damping": chosen}
        for each, treatment in variants
        for chosen in ([damping] if damping else ["default"] if each is None else DAMPINGS)
        for body in found
    ]


def _require_known(option: str, name: str, known: Any) -> None:
    if name not in known:
        raise OptionError(f"{option} {name!r} is not known: choose one of {', '.join(known)}")


def _sample(total: int, count: int) -> list[int]:
    """Choose `count` of `total` indices at random, with a fixed seed.

    A larger sample contains all smaller samples.
    """
    return sorted(np.random.default_rng(0).permutation(total)[:count].tolist())


def _own() -> Iterator[Cell]:
    for name in OWN_MESHES:
        yield {"group": "own", "name": name, "mesh": name, **USUAL}


def _foreign() -> Iterator[Cell]:
    for name in FOREIGN_MESHES:
        yield {"group": "foreign", "name": name, "mesh": name, **USUAL}


def _grid() -> Iterator[Cell]:
    """Yield the cells of the group `cells`.

    First come all combinations of values on two axes, with the default values on the other axes. Random
    combinations of values on all axes follow.
    """
    names = list(AXES)
    usual = tuple(USUAL[name] for name in names)
    chosen = {
        tuple({**dict(zip(names, usual, strict=True)), a: x, b: y}.values())
        for a, b in product(names, names)
        for x, y in product(AXES[a], AXES[b])
    }
    rest = sorted(set(product(*AXES.values())) - chosen)
    rng = np.random.default_rng(0)
    missing = CELL_COUNT - len(chosen)
    extra = [rest[k] for k in sorted(rng.choice(len(rest), max(0, missing), replace=False))]
    for number, values in enumerate([*sorted(chosen), *extra]):
        cell = dict(zip(names, values, strict=True))
        name = (
            f"{number}: E {cell['young']:.0e}, nu {cell['poisson']:g}, {cell['density']:g} kg/m^3, "
            f"{cell['scale']:g} m, 1/{1 / cell['dt']:.0f} s"
        )
        mesh = CELL_MESHES[number % len(CELL_MESHES)]
        yield {"group": "cells", "name": name, "mesh": mesh, **USUAL, **cell}


def _wrecked() -> Iterator[Cell]:
    for mesh, wreck, seed in product(WRECKED_MESHES, WRECKS, WRECKED_SEEDS):
        name = f"{mesh}, {wreck}, seed {seed}"
        yield {"group": "wrecked", "name": name, "mesh": mesh, **USUAL, "wreck": wreck, "seed": seed}


def random_wreck(number: int) -> Cell:
    """Return the cell of a strongly deformed body of random size and material.

    The body is stiff enough to bear its own weight.
    """
    rng = np.random.default_rng([number, 22])
    mesh, wreck = str(rng.choice(WRECKED_MESHES)), str(rng.choice(list(WRECKS)))
    scale, density = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in ((0.1, 3.0), (100.0, 3000.0)))
    stiffness = float(np.exp(rng.uniform(np.log(1 / MOST_SAG), np.log(100 / MOST_SAG))))
    values = {
        "scale": scale,
        "young": stiffness * density * GRAVITY_EARTH * scale,
        "poisson": float(rng.uniform(0.0, 0.45)),
        "density": density,
    }
    name = f"random {number}: {mesh}, {wreck}, {scale:.2g} m, E {values['young']:.1e}"
    body = {"group": "random wrecks", "name": name, "mesh": mesh, **USUAL, **values}
    return {**body, "wreck": wreck, "seed": number}


GROUPS: dict[str, Callable[[], Iterator[Cell]]] = {
    "foreign": _foreign,
    "own": _own,
    "cells": _grid,
    "wrecked": _wrecked,
}
"""Functions by name of a group. Each function yields the cells of its group, which do not yet have the keys
law, flips and damping."""
