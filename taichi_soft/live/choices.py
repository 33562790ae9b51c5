"""Run a scene's script with a chosen law, and with capacity for bodies that visitors add."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from taichi_soft import Material, SoftBodyAsset, World, box, cylinder, sphere, torus
from taichi_soft.core.types import FlipsName, LawName, StrainName

VISITOR = Material(young=1.5e5, poisson=0.4, density=500.0, damping_ratio=0.15)
"""Material of bodies that visitors add, until a slider changes it."""

SHAPES = ("ball", "block", "drum", "ring")
"""Shapes that visitors can add to every world."""

ROOM = 6
"""Number of bodies of each shape that visitors can add."""

PALETTES: WeakKeyDictionary[World, dict[str, SoftBodyAsset]] = WeakKeyDictionary()
"""Assets that visitors can add, by name, for each world."""


@contextmanager
def choices(
    *,
    law: LawName | None = None,
    strain: StrainName | None = None,
    flips: FlipsName | None = None,
    has_palette: bool = False,
    meshes: Sequence[str | Path] = (),
) -> Iterator[None]:
    """Return a context in which new worlds use other settings for all bodies. None keeps the scene's setting.

    A script saved by `taichi-soft live` begins with this context.
    Args:
        law, strain, flips: settings of all bodies, see `SoftBodyAsset`. A new law also replaces the scene's
            strain and flips, because the new law does not always support them.
        has_palette: True to let `World.build` reserve capacity for bodies that visitors add, see `PALETTES`.
        meshes: surface files. Visitors can add bodies of these shapes too.
    """
    kept = {name: getattr(World, name) for name in ("add_body", "reserve", "spawn", "build")}
    changed: dict[int, tuple[SoftBodyAsset, SoftBodyAsset]] = {}
    chosen: dict[str, Any] = {
        name: each for name, each in (("strain", strain), ("flips", flips)) if each is not None
    }
    if law is not None:
        chosen = {"law": law, "strain": strain, "flips": flips}

    def chosen_asset(asset: Any) -> Any:
        if not chosen or not isinstance(asset, SoftBodyAsset):
            return asset
        if id(asset) not in changed:
            changed[id(asset)] = asset, replace(asset, **chosen)
        return changed[id(asset)][1]

    @wraps(kept["add_body"])
    def add_body(world: World, mesh: Any, material: Any = None, **options: Any) -> Any:
        if isinstance(mesh, SoftBodyAsset):
            return kept["add_body"](world, chosen_asset(mesh), material, **options)
        return kept["add_body"](world, mesh, material, **{**options, **chosen})

    @wraps(kept["reserve"])
    def reserve(world: World, asset: Any, count: int) -> None:
        kept["reserve"](world, chosen_asset(asset), count)

    @wraps(kept["spawn"])
    def spawn(world: World, asset: Any, **options: Any) -> Any:
        return kept["spawn"](world, chosen_asset(asset), **options)

    @wraps(kept["build"])
    def build(world: World) -> None:
        if has_palette and not world.is_built:
            PALETTES[world] = palette = _palette(meshes)
            for asset in palette.values():
                reserve(world, asset, ROOM)
            PALETTES[world] = {name: chosen_asset(asset) for name, asset in palette.items()}
        kept["build"](world)

    for function in (add_body, reserve, spawn, build):
        setattr(World, function.__name__, function)
    try:
        yield
    finally:
        for name, function in kept.items():
            setattr(World, name, function)


def palette_of(world: World) -> dict[str, SoftBodyAsset]:
    """Return the assets that visitors can add to a world, by name."""
    return dict(PALETTES.get(world, {}))


def _palette(meshes: Sequence[str | Path]) -> dict[str, SoftBodyAsset]:
    """Return the assets of the shapes, which are about 0.5 m wide, and of the mesh files, by name."""
    shapes = (
        sphere(0.3, 3),
        box((0.5, 0.5, 0.5), (3, 3, 3)),
        cylinder(0.28, 0.5, rings=2, layers=4),
        torus(0.32, 0.13, rings=1, segments=18),
    )
    found = {name: SoftBodyAsset(mesh, VISITOR) for name, mesh in zip(SHAPES, shapes, strict=True)}
    for path in meshes:
        found[Path(path).stem] = SoftBodyAsset.from_surface(Path(path), VISITOR)
    return found
