"""What a body is made of, changed while it moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.kernels.constant_rows import write_fours, write_masses, write_numbers
from taichi_soft.bodies.layout import BodyArrays, Ranges, rearrange
from taichi_soft.bodies.soft_body import SoftBody, context_of, present_asset, record_of, redescribe
from taichi_soft.bodies.tet_constants import write_tet_constants
from taichi_soft.control.change import change
from taichi_soft.core.errors import MaterialError
from taichi_soft.elements.laws import fit_model


def set_material(body: SoftBody, material: Any) -> None:
    """As `Body.set_material`."""
    before = record_of(body).description
    if type(material) is not type(before.material):
        raise MaterialError(
            f"body {body.index} is made of a {type(before.material).__name__} and stays so: "
            f"got {type(material).__name__}"
        )
    fit_model(before.model, before.mesh, material)
    change(body, write_constants, body, replace(before, material=material))


def set_damping(body: SoftBody, damping: Any) -> None:
    """As `Body.set_damping`."""
    set_material(body, replace(body.material, damping=damping))


def write_constants(state: BodyFields, body: SoftBody, description: BodyDescription) -> None:
    """Not a kernel, but called like one: what a body is made of lies in several fields."""
    arrays = rearrange(context_of(body).layout.bodies[body.index], description)
    place = redescribe(body, description, arrays)
    masses = arrays.mass
    write_masses(state, place.particles[0], masses.astype(np.float32), (1.0 / masses).astype(np.float32))
    write_numbers(state.edge_damping, place.edges[0], arrays.edge_damping.astype(np.float32))
    fading, interval = np.array(present_asset(body).vibration_row(description), dtype=np.float32).reshape(
        2, 1
    )
    speed = np.array([description.sound_speed], dtype=np.float32)
    write_numbers(state.body_sound_speed, body.index, speed)
    write_numbers(state.body_fading, body.index, fading)
    write_numbers(state.body_fading_interval, body.index, interval)
    write_tet_constants(state, place.blocks[0], arrays)
    if arrays.bonds is not None:
        _write_bonds(state, arrays, place)


def _write_bonds(state: BodyFields, arrays: BodyArrays, place: Ranges) -> None:
    assert arrays.bonds is not None
    write_fours(state.edge_bond, place.edges[0], arrays.bonds.constants.astype(np.float32))
    if len(arrays.bonds.weights):
        write_fours(state.ring_weights, place.rings[0], arrays.bonds.weights.astype(np.float32))
