"""Write constants of one body to consecutive rows of a field, between two steps."""

from taichi_soft.core.runtime import ti


@ti.kernel
def write_numbers(target: ti.template(), first: ti.i32, rows: ti.types.ndarray(dtype=ti.f32, ndim=1)):
    """Copy numbers into the rows of a field, from row `first` on."""
    ti.loop_config(serialize=True)
    for i in range(rows.shape[0]):
        target[first + i] = rows[i]


@ti.kernel
def write_fours(target: ti.template(), first: ti.i32, rows: ti.types.ndarray(dtype=ti.f32, ndim=2)):
    """Copy rows of four numbers into a field of vectors, from row `first` on."""
    ti.loop_config(serialize=True)
    for i in range(rows.shape[0]):
        target[first + i] = ti.Vector([rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]])


@ti.kernel
def write_masses(
    state: ti.template(),
    first: ti.i32,
    masses: ti.types.ndarray(dtype=ti.f32, ndim=1),
    inverses: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    """Write masses [kg] and inverse masses [1/kg] of particles, from particle `first` on.

    Pinned particles keep an inverse mass of zero.
    """
    ti.loop_config(serialize=True)
    for i in range(masses.shape[0]):
        p = first + i
        state.particle_mass[p] = masses[i]
        state.particle_inv_mass[p] = ti.select(state.particle_inv_mass[p] > 0.0, inverses[i], 0.0)
