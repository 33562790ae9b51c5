"""Kernels for the stiffness of a body at its current positions, by element or as blocks of a matrix."""

from taichi_soft.core.constants import LANES
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.linear_system import (
    add_stiffness,
    bond_stiffness,
    clear_system,
    corner_stiffness,
    row_of,
    tet_stiffness,
    volume_pull,
)


@ti.kernel
def compute_tet_stiffness(state: ti.template(), model: ti.template(), out: ti.types.ndarray(ndim=3)):
    """Write the exact stiffness -df/dx of every tetrahedron of the first body, (m, 12, 12) [N/m]."""
    ti.loop_config(serialize=True)
    for t in range(out.shape[0]):
        block, lane = t // LANES, t % LANES
        g, element = tet_stiffness(state, model, block, lane, False)
        rows = ti.Matrix.rows([g[0], g[1], g[2], g[3]])
        for i in range(4):
            for j in range(4):
                columns = corner_stiffness(model, row_of(rows, i), row_of(rows, j), element, False)
                for a, b in ti.static(ti.ndrange(3, 3)):
                    out[t, 3 * i + a, 3 * j + b] = columns[b][a]


@ti.kernel
def compute_bond_stiffness(state: ti.template(), law: ti.template(), out: ti.types.ndarray(ndim=3)):
    """Write the exact result of `bond_stiffness` for every edge of the first body, (k, 3, 3) [N/m]."""
    ti.loop_config(serialize=True)
    for e in range(out.shape[0]):
        columns = bond_stiffness(state, law, e, False)
        for a, b in ti.static(ti.ndrange(3, 3)):
            out[e, a, b] = columns[b][a]


@ti.kernel
def compute_volume_pull(
    state: ti.template(), gradients: ti.types.ndarray(ndim=3), pulls: ti.types.ndarray(ndim=3)
):
    """Write the results of `volume_pull` for every tetrahedron of the first body, (m, 4, 3) each."""
    ti.loop_config(serialize=True)
    for t in range(gradients.shape[0]):
        g, w = volume_pull(state, t)
        for i, a in ti.static(ti.ndrange(4, 3)):
            gradients[t, i, a] = g[i][a]
            pulls[t, i, a] = w[i][a]


@ti.kernel
def compute_system_stiffness(state: ti.template(), program: ti.template()):
    """Set the blocks of the first body to its projected stiffness, without masses and damping."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        clear_system(state, 0)
        add_stiffness(state, program, 0, ti.cast(1.0, state.real))
