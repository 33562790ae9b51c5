"""What a world may have that the native library does not run."""

from __future__ import annotations

from taichi_soft.bodies.soft_body import present_asset, record_of
from taichi_soft.bodies.status import SKIPPING
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import device
from taichi_soft.core.types import Schedule
from taichi_soft.solver.context import WorldContext


def require_native(context: WorldContext) -> None:
    """Raises: OptionError with all that the native library has no place for, by name."""
    found = _of_world(context) + _of_assets(context) + _of_bodies(context)
    if found:
        raise OptionError(f"the native library does not run this world: {'; '.join(found)}")


def _of_world(context: WorldContext) -> list[str]:
    found = []
    if device().is_gpu:
        found.append(f"it runs on {device().arch}: call init('cpu')")
    if context.settings.schedule is Schedule.FLAT:
        found.append("schedule 'flat': make it with schedule='per_body'")
    if context.built.events.is_recording:
        found.append("it records events: leave record_events, on and watches out; the game records its own")
    return found


def _of_assets(context: WorldContext) -> list[str]:
    found = []
    for number, asset in enumerate(context.slots.kinds):
        if asset.spare_vertices:
            found.append(f"asset {number} is cut or tears: leave spare_vertices out")
        if asset.coarser:
            found.append(f"asset {number} has levels of detail: take one number of cells")
    return found


def _of_bodies(context: WorldContext) -> list[str]:
    found = [
        f"body {body.index} was given another material: make its asset of that"
        for body in context.slots.living
        if record_of(body).description is not present_asset(body).description
    ]
    status = context.built.state.body_status.to_numpy()
    return found + [
        f"body {body.index} skips the coming step: make a step before"
        for body in context.slots.living
        if status[body.index] == SKIPPING
    ]
