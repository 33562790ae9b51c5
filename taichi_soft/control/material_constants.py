"""Write the constants of a material to the fields of a body."""

from __future__ import annotations

import numpy as np

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.kernels.constant_rows import write_fours, write_masses, write_numbers
from taichi_soft.bodies.layout import BodyArrays, Ranges, rearrange
from taichi_soft.bodies.soft_body import SoftBody, context_of, present_asset, redescribe
from taichi_soft.bodies.tet_constants import constant_blocks, write_tet_constants
from taichi_soft.core.constants import LANES


def write_constants(state: BodyFields, body: SoftBody, description: BodyDescription) -> None:
    """Write all constants of a body's `description` to the fields.

    This function has the signature of a kernel, for `Built.change`.
    """
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
    write_stiffness(state, place, arrays)


def write_stiffness(state: BodyFields, place: Ranges, arrays: BodyArrays) -> None:
    """Write the constants of all elements and edges of a body, but not the masses of its particles."""
    write_tet_constants(state, place.blocks[0], arrays)
    if arrays.rods is not None:
        write_fours(state.rod_edge, place.particles[0], arrays.rods.edges.astype(np.float32))
        write_fours(state.rod_joint, place.particles[0], arrays.rods.joints.astype(np.float32))
    if arrays.shells is not None:
        for field, rows in state.shell_constants(arrays.shells):
            write_numbers(field, place.shells[0] * LANES * rows.shape[1], constant_blocks(rows))
    if arrays.bonds is None:
        return
    write_fours(state.edge_bond, place.edges[0], arrays.bonds.constants.astype(np.float32))
    if len(arrays.bonds.weights):
        write_fours(state.ring_weights, place.rings[0], arrays.bonds.weights.astype(np.float32))
