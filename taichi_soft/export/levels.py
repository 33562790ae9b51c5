"""Describe an asset's levels of detail for a world file, so that bodies can change their level."""

from __future__ import annotations

from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.tet_constants import constant_blocks
from taichi_soft.contact.fields import touching_edges
from taichi_soft.contact.hull_fields import touching_rows
from taichi_soft.fracture.cutting import body_rows, kind_numbers
from taichi_soft.fracture.kernels.topology import write_body
from taichi_soft.levels.passage import passage
from taichi_soft.solver.context import WorldContext

Arrays = dict[str, NDArray[Any]]

_ROWS = list(signature(write_body).parameters)[5:]
"""Names of the arrays that `body_rows` returns."""


def slot_arrays(context: WorldContext, number: int, asset: SoftBodyAsset) -> Arrays:
    """Return the arrays, by name, that are written into a slot when its body changes its level of detail.

    Args:
        context: context of the world.
        number: index of the asset in the world.
        asset: the level of an asset to which the body changes.
    """
    state, arrays = context.built.state, asset.arrays
    found: Arrays = {f"slot/{name}": rows for name, rows in zip(_ROWS, body_rows(arrays), strict=True)}
    found["slot/kind"] = kind_numbers(state, asset)
    for field, rows in state.tet_constants(arrays):
        name = next(name for name, each in vars(state).items() if each is field)
        found[f"constants/{name}"] = constant_blocks(rows)
    place = context.layout.ranges[context.slots.assets.index(context.slots.kinds[number])]
    if state.capacity.contact.hull:
        names = ("outer", "triangles", "carriers", "weights")
        found |= {
            f"touching/{name}": rows for name, rows in zip(names, touching_rows(arrays, place), strict=True)
        }
    if state.capacity.contact.soft:
        edges, sharp = touching_edges(arrays, place)
        found |= {"touching/edges": edges, "touching/sharp": np.array([sharp], dtype=np.int32)}
    return found


def constant_names(context: WorldContext) -> list[str]:
    """Return the names of the fields with constants of tetrahedra."""
    state = context.built.state
    fields = [field for field, _ in state.tet_constants(context.layout.bodies[0])]
    return [name for name, each in vars(state).items() if any(each is field for field in fields)]


def passage_arrays(asset: SoftBodyAsset) -> Arrays:
    """Return the arrays, by name, that map vertices between each two levels of an asset."""
    found: Arrays = {}
    levels = range(len(asset.levels))
    for source, target in ((i, j) for i in levels for j in levels if i != j):
        over = passage(asset, source, target)
        found |= {f"passage{source}-{target}/{name}": each for name, each in over.rows.items()}
    return found
