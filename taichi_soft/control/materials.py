"""Change the material of a body while it moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from taichi_soft.bodies.soft_body import SoftBody, context_of, record_of
from taichi_soft.control.easing import Easings
from taichi_soft.core.errors import MaterialError
from taichi_soft.elements.laws import fit_model
from taichi_soft.elements.materials.rigid import RigidMaterial


def set_material(body: SoftBody, material: Any) -> None:
    """Implement `Body.set_material`."""
    before = record_of(body).description
    if type(material) is not type(before.material):
        raise MaterialError(
            f"body {body.index} has a {type(before.material).__name__}, and its type cannot change: "
            f"got {type(material).__name__}"
        )
    fit_model(before.model, before.mesh, material)
    context_of(body).of(Easings).begin(body, material)


def set_damping(body: SoftBody, damping: Any) -> None:
    """Implement `Body.set_damping`."""
    if isinstance(body.material, RigidMaterial):
        raise MaterialError(f"body {body.index} is rigid, so that its material has no damping")
    set_material(body, replace(body.material, damping=damping))
