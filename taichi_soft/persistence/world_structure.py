"""Structure of a world as plain data. A snapshot can be restored only in a world of the same structure."""

from __future__ import annotations

from dataclasses import asdict
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.bodies.capacity import ROOMS
from taichi_soft.core.errors import SnapshotError
from taichi_soft.core.serialisation import as_plain, digest_of, from_json, to_json
from taichi_soft.solver.context import WorldContext


def structure_of(context: WorldContext) -> bytes:
    """Return the structure of a world, as JSON."""
    # Leave out gravity and the floor's friction and height, because they can change. The manifest contains
    # them.
    settings = {
        name: as_plain(value)
        for name, value in asdict(context.settings).items()
        if name not in ("gravity", "friction")
    }
    settings["floor"] = as_plain(context.first_floor)
    capacity = asdict(context.built.state.capacity)
    del capacity["contact"]["edges"]  # like `ROOMS`, it can be larger than needed
    return to_json(
        {
            "package": _package_version(),
            "slices": [each.name for each in context.slices],
            # Leave out the sizes of fields. They follow from the bodies, and reused fields can be larger.
            "capacity": {name: value for name, value in capacity.items() if name not in ROOMS},
            "soft_contact": context.contact.soft,
            "sleep_speed": context.contact.sleep_speed,
            **settings,
            "bodies": [asset_digest(asset) for asset in context.slots.assets],
        }
    )


def _package_version() -> str:
    try:
        return version("taichi-soft")
    except PackageNotFoundError:
        return "not installed"


def asset_digest(asset: SoftBodyAsset) -> str:
    """Return a digest of an asset's mesh, material and options."""
    described = asset.description
    model = described.model
    parts = [model.law.name, model.strain, model.flips, model.damping_model]
    touch = asset.contact
    thickness = None if touch.thickness is None else float(touch.thickness)
    contact: list[Any] = [float(touch.friction), thickness, touch.itself, touch.group, touch.mask]
    flow = None if asset.plasticity is None else [float(each) for each in asset.plasticity.row]
    tear = None if asset.tearing is None else [float(asset.tearing.stress), asset.tearing.most]
    contact += [flow, asset.spare_vertices, tear, [asset_digest(each) for each in asset.coarser]]
    contact += [] if asset.hull is None else [digest_of(asset.hull)]
    contact += [] if touch.faces else ["no faces"]
    content = [digest_of(described.mesh), digest_of(described.material), described.pinned.tolist()]
    return blake2b(to_json([as_plain(parts), content, contact]), digest_size=8).hexdigest()


def require_structure(saved_bytes: bytes, expected_bytes: bytes) -> None:
    """Check that two structures are equal. Raises: SnapshotError with the first difference."""
    if saved_bytes == expected_bytes:
        return
    saved, expected = from_json(saved_bytes), from_json(expected_bytes)
    if not isinstance(saved, dict):
        raise SnapshotError("this snapshot is invalid: it has no structure of its world")
    for name, value in expected.items():
        other = saved.get(name)
        if other == value:
            continue
        if name == "bodies" and isinstance(other, list) and len(other) == len(value):
            slot = next(i for i, (a, b) in enumerate(zip(other, value, strict=True)) if a != b)
            raise SnapshotError(
                f"this snapshot is of another world: the asset of body {slot} has another mesh, material, "
                "law or options"
            )
        if name == "bodies" and isinstance(other, list):
            value, other = len(value), len(other)
        raise SnapshotError(
            f"this snapshot is of another world: its {name} is {str(other)[:200]}, but this world has "
            f"{str(value)[:200]}"
        )
    raise SnapshotError("this snapshot is of another world")
