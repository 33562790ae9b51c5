"""Pack the state of a world between two steps into one array, and unpack it, without loss."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.kernels.origins import local_position
from taichi_soft.bodies.status import ABSENT
from taichi_soft.core.field_table import WORLD
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.state import State

LONG_GROUP = 256
"""Smallest number of rows for which copying a group of fields takes a significant part of a snapshot's
time."""


def row_table(state: State, counts: Mapping[str, int]) -> NDArray[np.int32]:
    """Return row count, width and first word of each group, (groups + 1, 3). The last row marks the end.

    Args:
        state: fields of the world.
        counts: number of rows by name of the group.
    """
    rows, at = [], 0
    for name, group in state.kept.items():
        width = sum(each for _, _, each in group)
        rows.append((counts[name], width, at))
        at += counts[name] * width
    return np.array([*rows, (0, 0, at)], dtype=np.int32)


def _groups(state: State) -> list[tuple[int, str]]:
    return list(enumerate(state.kept))


def _is_long(state: State, group: str) -> bool:
    """True if copying the rows with vector instructions is worth the longer compile time."""
    return group != WORLD and all(field.shape[0] >= LONG_GROUP for field, _, _ in state.kept[group])


@ti.func
def _copy_row(
    state: ti.template(),
    table: ti.template(),
    words: ti.template(),
    packs: ti.template(),
    number: ti.template(),
    group: ti.template(),
    i,
):
    for field, column, width in ti.static(state.kept[group]):
        at = table[number, 2] + i * table[number, 1] + column
        for k in ti.static(range(width)):
            if ti.static(group == WORLD):
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
    """Copy all kept fields to `words`, in the layout of `table`. If `packs` is False, copy back."""
    for number, group in ti.static(_groups(state)):
        if ti.static(_is_long(state, group)):
            ti.loop_config(serialize=True)
            for i in range(table[number, 0]):
                _copy_row(state, table, words, packs, number, group, i)
        else:
            i = 0
            while i < table[number, 0]:
                _copy_row(state, table, words, packs, number, group, i)
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
    """Return a hash of the status of all slots, and of positions, velocities and pins of their bodies."""
    code = ti.u64(1469598103934665603)
    ti.loop_config(serialize=True)
    for body in range(body_count):
        code = _mix(code, _word(state.body_status[body]))
        if state.body_status[body] != ABSENT:
            code = _mix_two(code, state.body_velocity_lag[body], state.body_drives[body])
            code = _mix_two(code, state.body_gravity_scale[body], state.body_damping[body])
            particles = state.body_particles[body]
            if (state.body_origin[body] != 0.0).any():
                for p in range(particles[0], particles[1]):
                    x = local_position(state, body, p)
                    for k in ti.static(range(3)):
                        code = _mix(code, _word(x[k]))
            for p in range(particles[0], particles[1]):
                x, v = state.particle_position[p], state.particle_velocity[p]
                for k in ti.static(range(3)):
                    code = _mix_two(code, x[k], v[k])
                code = _mix_two(code, state.particle_inv_mass[p], state.particle_aim[p])
    return ti.cast(code, ti.i64)
