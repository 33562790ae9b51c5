"""Change the friction of bodies, and of a floor that is not a collider."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from taichi_soft.bodies.soft_body import Context, SoftBody, context_of, record_of
from taichi_soft.control.change import change
from taichi_soft.control.kernels.friction import write_friction
from taichi_soft.core.checks import as_friction
from taichi_soft.core.errors import StateError


def set_floor_friction(context: Context, friction: float) -> None:
    """Implement `World.set_friction` for a floor that is not a collider."""
    coefficient = as_friction(friction)
    if context.settings.floor is None:
        raise StateError(
            "the world has no floor: use Collider.set_friction for a collider, or Body.set_friction for "
            "contact between bodies"
        )
    if coefficient != context.settings.friction:
        context.apply_settings(replace(context.settings, friction=coefficient))
        if context.fields is not None:
            context.fields.mark_modified(-1)


def set_friction(body: SoftBody, friction: float) -> None:
    """Implement `Body.set_friction`."""
    context, coefficient = context_of(body), as_friction(friction)
    if not context.built.state.capacity.contact.soft:
        raise StateError(
            "a body's friction applies between bodies, and this world has no contact between bodies: "
            "make it with World(soft_contact=True), or use World.set_friction for the floor and "
            "Collider.set_friction for a collider"
        )
    if coefficient != body.friction:
        change(body, give_friction, body, coefficient)


def give_friction(state: Any, body: SoftBody, friction: float | None) -> None:
    """Store the friction of a body, and write it to the fields. None: the friction of the body's asset.

    This function has the signature of a kernel, for `Built.change`.
    """
    record = record_of(body)
    record.friction = None if friction == body.asset.contact.friction else friction
    if state.capacity.contact.soft:
        write_friction(state, body.index, body.friction)
