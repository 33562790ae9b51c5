"""Find the memory address of a world's fields."""

from taichi_soft.core.runtime import ti


@ti.kernel
def read_root(state: ti.template(), found: ti.types.ndarray(dtype=ti.u64, ndim=1)):
    """Write the address of the first particle's position to `found`, (1,).

    The addresses of all other fields have known offsets from this address.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        found[0] = ti.get_addr(state.particle_position, [0])
