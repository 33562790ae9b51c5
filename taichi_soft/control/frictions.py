"""Friction of bodies against each other, and of a floor that is no collider, changed while they move."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from taichi_soft.bodies.soft_body import Context, SoftBody, context_of, record_of
from taichi_soft.control.change import change
from taichi_soft.control.kernels.friction import write_friction
from taichi_soft.core.checks import as_friction
from taichi_soft.core.errors import StateError


def set_floor_friction(context: Context, friction: float) -> None:
    """As `World.set_friction`, where the floor is no collider."""
    coefficient = as_friction(friction)
    if context.settings.floor is None:
        raise StateError(
            "the world has no floor: a collider's friction is changed by Collider.set_friction, that between "
            "bodies by Body.set_friction"
        )
    if coefficient != context.settings.friction:
        context.apply_settings(replace(context.settings, friction=coefficient))
        if context.fields is not None:
            context.fields.mark_modified(-1)


def set_friction(body: SoftBody, friction: float) -> None:
    """As `Body.set_friction`."""
    context, coefficient = context_of(body), as_friction(friction)
    if not context.built.state.capacity.contact.soft:
        raise StateError(
            "a body's friction counts between bodies, and these do not touch each other: make the world with "
            "soft_contact, or change the floor's by World.set_friction, a collider's by Collider.set_friction"
        )
    if coefficient != body.friction:
        change(body, give_friction, body, coefficient)


def give_friction(state: Any, body: SoftBody, friction: float | None) -> None:
    """Not a kernel, but called like one: note the friction of a body, and write it. None is its asset's."""
    record = record_of(body)
    record.friction = None if friction == body.asset.contact.friction else friction
    if state.capacity.contact.soft:
        write_friction(state, body.index, body.friction)
