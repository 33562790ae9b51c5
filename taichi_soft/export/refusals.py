"""What a world may have that the native library does not run: why, and what to do instead."""

from __future__ import annotations

from taichi_soft.bodies.soft_body import present_asset, record_of
from taichi_soft.bodies.status import SKIPPING
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import device
from taichi_soft.core.types import Schedule
from taichi_soft.solver.context import WorldContext

FLAT = (
    "it has schedule 'flat', whose loops over the particles of the whole world have no place for contact, "
    "forces, grabs, joints and motors, which the library's calls take: make it with schedule='per_body'"
)
RECORDS = (
    "it records events, and Python would go on to collect them; stress is watched by Python too, which reads "
    "it of each tetrahedron after each step: leave record_events, on and watches out, and let the game call "
    "ts_world_record_events"
)
FORCE_FIELD = (
    "it has a force field, a function in Python that the library cannot call: take it out with "
    "set_force_field(None), and let the game push in the function of ts_world_on_step, by "
    "ts_body_apply_force, ts_world_set_wind or ts_world_radial_impulse"
)
CUT = (
    "is cut or tears, and Python makes the new mesh of a body that is cut: leave spare_vertices out, and let "
    "the game put bodies of the parts in its place, by ts_world_despawn and ts_world_spawn"
)
MATERIAL = (
    "was given another material, and the library takes the constants of a body from its asset: make its "
    "asset of that material"
)
SKIPS = (
    "skips the coming step, and Python alone chooses who skips steps: make a step with World.step before the "
    "export, and let the game despawn what is far away"
)


def require_native(context: WorldContext, *, has_force_field: bool) -> None:
    """Raises: OptionError with all that the native library has no place for: why, and the way out."""
    found = _of_world(context, has_force_field) + _of_assets(context) + _of_bodies(context)
    if found:
        raise OptionError(f"the native library does not run this world: {'; '.join(found)}")


def _of_world(context: WorldContext, has_force_field: bool) -> list[str]:
    found = []
    if device().is_gpu:
        found.append(
            f"it runs on {device().arch}, and its kernels become code for processors: call init('cpu')"
        )
    if context.settings.schedule is Schedule.FLAT:
        found.append(FLAT)
    if context.built.events.is_recording:
        found.append(RECORDS)
    return found + [FORCE_FIELD] * has_force_field


def _of_assets(context: WorldContext) -> list[str]:
    found = []
    for number, asset in enumerate(context.slots.kinds):
        found += [f"asset {number} {CUT}"] * bool(asset.spare_vertices)
    return found


def _of_bodies(context: WorldContext) -> list[str]:
    status = context.built.state.body_status.to_numpy()
    found = []
    for body in context.slots.occupants:
        if record_of(body).description is not present_asset(body).description:
            found.append(f"body {body.index} {MATERIAL}")
        if status[body.index] == SKIPPING:
            found.append(f"body {body.index} {SKIPS}")
    return found
