"""Features that the native library does not support, with reasons and alternatives."""

from __future__ import annotations

from taichi_soft.bodies.soft_body import present_asset, record_of
from taichi_soft.bodies.status import SKIPPING
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import device
from taichi_soft.core.types import Schedule
from taichi_soft.solver.context import WorldContext

FLAT = (
    "it has schedule 'flat', which does not support the contact, forces, grabs, joints and motors of the "
    "library: make it with schedule='per_body'"
)
RECORDS = (
    "it records events or watches stress, which runs in Python: leave out record_events, on and watches, and "
    "let the game call "
    "ts_world_record_events"
)
FORCE_FIELD = (
    "it has a force field, a Python function that the library cannot call: remove it with "
    "set_force_field(None), and apply forces in the callback of ts_world_on_step with "
    "ts_body_apply_force, ts_world_set_wind or ts_world_radial_impulse"
)
CUT = (
    "can be cut or torn, which needs Python: leave out spare_vertices, and let the game replace the body by "
    "its parts, with ts_world_despawn and ts_world_spawn"
)
MATERIAL = (
    "was given another material, and the library uses the material of its asset: make the asset with that "
    "material"
)
SKIPS = (
    "skips the next step, and only Python can skip steps: call World.step before the export, and let the "
    "game despawn distant bodies"
)


def require_native(context: WorldContext, *, has_force_field: bool) -> None:
    """Check that the native library supports a world. Raises: OptionError with all unsupported features."""
    found = _of_world(context, has_force_field) + _of_assets(context) + _of_bodies(context)
    if found:
        raise OptionError(f"the native library does not run this world: {'; '.join(found)}")


def _of_world(context: WorldContext, has_force_field: bool) -> list[str]:
    found = []
    if device().is_gpu:
        found.append(f"it runs on {device().arch}, and only CPU kernels can be exported: call init('cpu')")
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
