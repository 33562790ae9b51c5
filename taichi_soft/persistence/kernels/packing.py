"""Pack the state that passes from one step to the next into one array, and unpack it, bit by bit."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.status import ABSENT
from taichi_soft.core.constants import LANES
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.state import State

OWNERS = PARTICLE, BODY, SHAPE, WORLD = range(4)
"""Owner of a field's rows: a particle, a body, an entry of a rest shape, or the world. The groups of slices
follow."""

LONG_GROUP = 256
"""Rows from which copying a group takes a relevant part of the time of a snapshot."""


def carried(state: State, owner: int) -> list[tuple[Any, int, int]]:
    """Fields that the next step, or a read before it, depends on: (field, column, width).

    All other fields are constant, follow from the assets, or are written in each step before they are read:
    forces, boxes, contact candidates, islands.
    """
    is_implicit = state.capacity.implicit
    fields: list[Any] = []
    if owner == PARTICLE:
        fields += [state.particle_position, state.particle_velocity, state.prev_position, state.prev_velocity]
        fields += [state.particle_mass, state.particle_inv_mass, state.particle_aim, state.particle_target]
        fields += [state.particle_push, state.particle_reaction]
        fields += [state.particle_contact] if is_implicit else []
    elif owner == BODY:
        fields += [state.body_status, state.body_velocity_lag, state.body_drives]
        fields += [state.body_gravity_scale, state.body_damping, state.body_patience]
        fields += [state.body_refinement]
        fields += [state.body_fading, state.body_fading_interval, state.body_sound_speed]
        fields += [state.body_residual] if is_implicit else []
    elif owner == SHAPE:
        fields += [state.tet_rest_inverse] if state.capacity.plastic else []
    elif owner == WORLD:
        fields += [state.wind]
    else:
        fields += slice_groups(state)[owner - len(OWNERS)]
    widths = [getattr(field, "n", 1) for field in fields]
    return [(field, sum(widths[:i]), widths[i]) for i, field in enumerate(fields)]


def slice_groups(state: State) -> list[list[Any]]:
    """Groups of fields of all slices."""
    return [group for groups in state.carried.values() for group in groups]


def owners(state: State) -> range:
    """Indices of all groups of fields."""
    return range(len(OWNERS) + len(slice_groups(state)))


def row_table(
    state: State, particles: int, bodies: int, blocks: int, of_slices: list[int]
) -> NDArray[np.int32]:
    """Row count, width and start of each owner, (owners + 1, 3). The last row marks the end.

    Args: of_slices: used rows of each group of `slice_groups`.
    """
    counts = [particles, bodies, blocks * 9 * LANES, 1, *of_slices]
    rows, at = [], 0
    for owner in owners(state):
        width = sum(each for _, _, each in carried(state, owner))
        rows.append((counts[owner], width, at))
        at += counts[owner] * width
    return np.array([*rows, (0, 0, at)], dtype=np.int32)


def _is_long(state: State, owner: int) -> bool:
    """True if copying the rows with vector instructions is worth the longer compile time."""
    return owner != WORLD and all(field.shape[0] >= LONG_GROUP for field, _, _ in carried(state, owner))


@ti.func
def _copy_row(
    state: ti.template(),
    table: ti.template(),
    words: ti.template(),
    packs: ti.template(),
    owner: ti.template(),
    i,
):
    for field, column, width in ti.static(carried(state, owner)):
        at = table[owner, 2] + i * table[owner, 1] + column
        for k in ti.static(range(width)):
            if ti.static(owner == WORLD):
                if ti.static(packs):
                    words[at + k] = ti.bit_cast(field[None][k], ti.i32)
                else:
                    field[None][k] = ti.bit_cast(words[at + k], field.dtype)
            elif ti.static(width == 1):
                if ti.static(packs):
                    words[at] = ti.bit_cast(field[i], ti.i32)
                else:
                    field[i] = ti.bit_cast(words[at], field.dtype)
            elif ti.static(packs):
                words[at + k] = ti.bit_cast(field[i][k], ti.i32)
            else:
                field[i][k] = ti.bit_cast(words[at + k], field.dtype)


@ti.kernel
def copy_state(
    state: ti.template(),
    table: ti.types.ndarray(dtype=ti.i32, ndim=2),
    words: ti.types.ndarray(dtype=ti.i32, ndim=1),
    packs: ti.template(),
):
    """Copy all `carried` fields to `words` in the layout of `table`, or from `words` if `packs` is False."""
    for owner in ti.static(owners(state)):
        if ti.static(_is_long(state, owner)):
            ti.loop_config(serialize=True)
            for i in range(table[owner, 0]):
                _copy_row(state, table, words, packs, owner, i)
        else:
            i = 0
            while i < table[owner, 0]:
                _copy_row(state, table, words, packs, owner, i)
                i = row_behind(i)


@ti.func
def _word(x):
    return ti.cast(ti.bit_cast(x, ti.u32), ti.u64)


@ti.func
def _mix(code, word):
    """Add a word to a hash: 64-bit FNV-1a (Fowler, Noll, Vo) on words, followed by a shift."""
    mixed = (code ^ word) * ti.u64(1099511628211)
    return mixed ^ (mixed >> ti.u64(29))


@ti.func
def _mix_two(code, x, y):
    """Add two 32-bit numbers to a hash at once."""
    return _mix(code, _word(x) | (_word(y) << ti.u64(32)))


@ti.kernel
def hash_bodies(state: ti.template(), body_count: ti.i32) -> ti.i64:
    """Hash of the state: status of all slots; positions, velocities and pins of the bodies in them."""
    code = ti.u64(1469598103934665603)
    ti.loop_config(serialize=True)
    for body in range(body_count):
        code = _mix(code, _word(state.body_status[body]))
        if state.body_status[body] != ABSENT:
            code = _mix_two(code, state.body_velocity_lag[body], state.body_drives[body])
            code = _mix_two(code, state.body_gravity_scale[body], state.body_damping[body])
            particles = state.body_particles[body]
            for p in range(particles[0], particles[1]):
                x, v = state.particle_position[p], state.particle_velocity[p]
                for k in ti.static(range(3)):
                    code = _mix_two(code, x[k], v[k])
                code = _mix_two(code, state.particle_inv_mass[p], state.particle_aim[p])
    return ti.cast(code, ti.i64)
