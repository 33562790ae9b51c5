"""Write the settings that apply to all bodies of a world."""

from taichi_soft.core.runtime import ti


@ti.kernel
def write_surroundings(state: ti.template(), numbers: ti.types.ndarray(dtype=ti.f64, ndim=1)):
    """Write gravity, floor, and settings of retries and implicit Euler with one kernel.

    If Python wrote each number separately, Taichi would compile one kernel per number.
    Args:
        numbers: gravity [m/s^2]; height [m], restitution and friction of the floor; tolerance and largest
            number of iterations of implicit Euler; number of retries, (9,).
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
