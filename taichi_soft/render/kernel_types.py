# mypy: ignore-errors
# (Taichi's argument annotations are values, which a type checker cannot read.)
"""Argument types of the drawing kernels: NumPy arrays, whose length can change without recompiling."""

from taichi_soft.core.runtime import ti

TILE = 32
"""Edge of a tile [pixels]. If tiles are smaller, each triangle is processed in more tiles. If tiles are
larger, the work of the threads is less equal."""

vec3 = ti.types.vector(3, ti.f32)
matrix = ti.types.matrix(4, 4, ti.f32)
reals = ti.types.ndarray(dtype=ti.f32, ndim=1)
rows = ti.types.ndarray(dtype=ti.f32, ndim=2)
ints = ti.types.ndarray(dtype=ti.i32, ndim=1)
int_rows = ti.types.ndarray(dtype=ti.i32, ndim=2)
image = ti.types.ndarray(dtype=ti.f32, ndim=3)
byte_rows = ti.types.ndarray(dtype=ti.u8, ndim=2)
picture = ti.types.ndarray(dtype=ti.u8, ndim=3)


@ti.func
def row_vec2(array: ti.template(), i):
    """Return row i of an (n, 2) array as a vector."""
    return ti.Vector([array[i, 0], array[i, 1]])


@ti.func
def row_vec3(array: ti.template(), i):
    """Return row i of an (n, 3) array as a vector."""
    return ti.Vector([array[i, 0], array[i, 1], array[i, 2]])
