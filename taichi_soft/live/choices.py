"""A scene with another law, and with room for what visitors add, without a change of its script."""

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
"""Of what visitors add, until a slider says otherwise."""

SHAPES = ("ball", "block", "drum", "ring")
"""Names of those that every world has room for."""

ROOM = 6
"""Bodies of each kind that visitors may add."""

PALETTES: WeakKeyDictionary[World, dict[str, SoftBodyAsset]] = WeakKeyDictionary()
"""What visitors may add to a world, by name."""


@contextmanager
def choices(
    *,
    law: LawName | None = None,
    strain: StrainName | None = None,
    flips: FlipsName | None = None,
    has_palette: bool = False,
    meshes: Sequence[str | Path] = (),
) -> Iterator[None]:
    """Worlds that are made within it have bodies of this law; None leaves each choice as the scene has it.

    A saved scene of `taichi-soft live` begins with it.
    Args:
        law, strain, flips: of all bodies, as `SoftBodyAsset` takes them. With a law the scene's own strain
            and flips are dropped, which another law may not take.
        has_palette: whether `World.build` makes room for shapes that visitors add: see `PALETTES`.
        meshes: files of surfaces that they may add as well.
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
    """What visitors may add, by name."""
    return dict(PALETTES.get(world, {}))


def _palette(meshes: Sequence[str | Path]) -> dict[str, SoftBodyAsset]:
    """Shapes of about half a metre, and the surfaces of files, by name."""
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
