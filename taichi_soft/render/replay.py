"""Replay a recording: rebuild the world, repeat its calls, compare the states, and report failures."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.failure import Failure
from taichi_soft.control.drives import accelerate_bodies
from taichi_soft.core.checks import as_count, as_path
from taichi_soft.core.errors import FrozenBodyWarning, SnapshotError, TaichiSoftError, VideoError
from taichi_soft.core.handles import Handle, handles_of, is_recorded
from taichi_soft.core.serialisation import from_plain
from taichi_soft.persistence.recorder import read_recording
from taichi_soft.render import FLIPPED, PALETTE, Camera, Renderer, Surface, draw_text, highlight
from taichi_soft.render.opencv import cv2
from taichi_soft.render.props import Scenery
from taichi_soft.world.body import Body
from taichi_soft.world.world import World, context_of_world


@dataclass(frozen=True)
class ReplayReport:
    """Result of a replay."""

    world: World  # replayed world in its final state
    steps: int  # number of replayed steps
    first_difference: int | None  # step count of the first state that differs from the recording, or None
    failures: tuple[Failure, ...]  # failures of bodies that are frozen at the end
    picture: Path | None
    hash: str  # hash of the last state, equal to the hash that web pages and the C library print


def replay(path: Any, picture: Any = None, steps: int | None = None) -> ReplayReport:
    """Replay a recording.

    Args:
        path: file written by `World.save_recording`, by a frozen body or by a page of the gallery.
        picture: path for an image of the final state, .png; None draws nothing.
        steps: largest number of steps; None replays all.
    Raises: SnapshotError for a damaged file, a file that is not a recording, or a recording from another
        version of this package; VideoError if the image cannot be written.
    """
    target = None if picture is None else as_path(picture)
    most = math.inf if steps is None else as_count(steps, "steps", 0)
    made_of, snapshot = read_recording(path)
    try:
        world, parts = _rebuilt(made_of)
        entries = made_of["entries"]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, TaichiSoftError):
            raise
        raise SnapshotError(f"this recording is damaged: {error!r}") from None
    world.restore(snapshot)
    made, difference = 0, None
    for entry in entries:
        if made == most:
            break
        try:
            if entry[0] == "call":
                _call(world, parts, *entry[1:])
                continue
            expected = _step(world, *entry[1:])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SnapshotError(f"this recording stops after {made} steps: {error}") from None
        made += 1
        if difference is None and not _is_state(world, expected):
            difference = world.step_count
    failures = tuple(body.failure for body in world.bodies if body.failure is not None)
    if target is not None:
        _draw(world, failures, target)
    return ReplayReport(world, made, difference, failures, target, world.bodies_hash())


def _is_state(world: World, expected: str) -> bool:
    """True if `expected` is the `state_hash` of the world, or the `bodies_hash` that web pages record."""
    return expected in (world.state_hash(), world.bodies_hash())


def _rebuilt(made_of: dict[str, Any]) -> tuple[World, dict[str, Any]]:
    """Build a world with the recorded structure. Returns: the world, and its assets and shapes by digest."""
    shapes: dict[str, Any] = {name: from_plain(data) for name, data in made_of["shapes"].items()}
    assets = {name: _asset(options) for name, options in made_of["assets"].items()}
    world = World(**made_of["world"])
    for name in made_of["slots"]:
        world.reserve(assets[name], 1)
    for name in made_of["built_with"]:
        world.add_collider(shapes[name])
    world.build()
    context_of_world(world).colliders.shapes.update(shapes)
    return world, {**shapes, **assets}


def _asset(options: dict[str, Any]) -> SoftBodyAsset:
    plain = dict(options)
    mesh, material = from_plain(plain.pop("mesh")), from_plain(plain.pop("material"))
    for name in ("contact", "plasticity", "tearing", "hull"):
        plain[name] = from_plain(plain.get(name))
    coarser = tuple(_asset(each) for each in plain.pop("coarser"))
    return SoftBodyAsset(mesh, material, coarser=coarser, **plain)


def _call(world: World, parts: dict[str, Any], serial: int, name: str, arguments: Any, options: Any) -> None:
    """Repeat a recorded call. Raises: SnapshotError for a call that recorders do not store."""
    handle: Handle | None = world if serial == 0 else handles_of(world).find(serial, Handle)
    if handle is None or not is_recorded(handle, name):
        raise SnapshotError(f"{name!r} of handle {serial} is not a call that recordings contain")
    given = [_value(world, parts, each) for each in arguments]
    named = {key: _value(world, parts, each) for key, each in options["options"].items()}
    getattr(handle, name)(*given, **named)


def _value(world: World, parts: dict[str, Any], data: Any) -> Any:
    if isinstance(data, list):
        return [_value(world, parts, each) for each in data]
    if isinstance(data, dict) and "handle" in data:
        return handles_of(world).find(data["handle"], Handle)
    if isinstance(data, dict) and "part" in data:
        return parts[data["part"]]
    return from_plain(data)


def _step(world: World, seconds: float, substeps: int | None, expected: str, pushes: list[Any]) -> str:
    """Repeat a recorded step with its accelerations. Returns: `expected`, the recorded hash of the state."""
    rows = []
    for serial, data in pushes:
        body = handles_of(world).find(serial, Body)
        if body is None:
            raise SnapshotError(f"body {serial} does not exist")
        rows.append((body, from_plain(data)))
    accelerate_bodies(rows)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)  # the report lists the failures
        world.step(seconds, substeps)
    return expected


def _draw(world: World, failures: tuple[Failure, ...], path: Path) -> None:
    """Draw the world with the failed parts marked, and write the image."""
    broken = {failure.body: failure for failure in failures}
    surfaces = []
    for body in world.bodies:
        if len(body.surface):
            surface = Surface.of(body.mesh, color=PALETTE[body.index % len(PALETTE)])
            surface.positions = body.positions()
            failure = broken.get(body.index)
            if failure is not None and failure.tetrahedron is not None:
                marked = np.zeros(body.vertex_count, dtype=np.bool_)
                marked[body.tets[failure.tetrahedron]] = True
                surface.color = highlight(marked, PALETTE[body.index % len(PALETTE)], FLIPPED)
            surfaces.append(surface)
    wanted = [body for body in world.bodies if body.index in broken] or list(world.bodies)
    boxes = [body.aabb() for body in wanted]
    lower = np.min([low for low, _ in boxes], axis=0) if boxes else np.full(3, -1.0)
    upper = np.max([high for _, high in boxes], axis=0) if boxes else np.ones(3)
    renderer = Renderer(
        1280,
        720,
        camera=Camera.framing(lower, upper, aspect=1280 / 720, margin=1.5),
        floor=world.settings.floor,
    )
    image = renderer.render([*Scenery(world).at(1.0), *surfaces])
    draw_text(image, [f"step {world.step_count}, t = {world.time:.3f} s", *map(failure_line, failures)])
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() != ".png" or not cv2.imwrite(str(path), np.ascontiguousarray(image[:, :, ::-1])):
        raise VideoError(f"cannot write {str(path)!r}: name a .png file in a writable folder")


def failure_line(failure: Failure) -> str:
    """Describe a failure in one line."""
    part = "an unknown part"
    if failure.tetrahedron is not None:
        part = f"tetrahedron {failure.tetrahedron}"
    elif failure.edge is not None:
        part = f"edge {failure.edge[0]}-{failure.edge[1]}"
    elif failure.triangle is not None:
        part = f"triangle {failure.triangle}"
    where = "" if failure.substep is None else f", substep {failure.substep}"
    return f"body {failure.body}: {part} failed first, in step {failure.step}{where}"
