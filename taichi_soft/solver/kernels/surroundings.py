"""The numbers that hold for all bodies of a world, into their fields."""

from taichi_soft.core.runtime import ti


@ti.kernel
def write_surroundings(state: ti.template(), numbers: ti.types.ndarray(dtype=ti.f64, ndim=1)):
    """One kernel for all: Taichi compiles one for each number of a field that Python writes.

    Args:
        numbers: gravity [m/s^2]; height [m], restitution and friction of the floor; tolerance and most
            iterations of implicit Euler; how often a step that fails is made again, (9,).
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        for k in ti.static(range(3)):
            state.gravity[None][k] = ti.cast(numbers[k], state.real)
            state.floor[None][k] = ti.cast(numbers[3 + k], state.real)
        if ti.static(state.capacity.implicit):
            for k in ti.static(range(2)):
                state.solver[None][k] = ti.cast(numbers[6 + k], state.real)
        state.retries[None] = ti.cast(numbers[8], ti.i32)
