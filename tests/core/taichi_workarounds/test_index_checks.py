"""With `TAICHI_SOFT_DEBUG=1`, every wrong index is reported. Each test uses a separate process."""

import os
import subprocess
import sys

CHECKED = """
import sys
import numpy as np
from taichi_soft import MeshShape, init
from taichi_soft.core.runtime import ti

init("cpu", threads=1)
around = [ti.field(ti.f32, 1024)]  # a wrong access is made as well, where no memory may be
field = ti.field(ti.f32, 10)
rows = ti.Vector.field(3, ti.f32, 10)
around.append(ti.field(ti.f32, 1024))
array = np.zeros((4, 4), np.float32)[:3]

@ti.real_func
def deep(field: ti.template(), rows: ti.template(), i: ti.i32) -> ti.f32:
    rows[i].y = 1.0
    return field[i] + rows[i].y

@ti.kernel
def real(field: ti.template(), rows: ti.template(), i: ti.i32) -> ti.f32:
    return deep(field, rows, i)

@ti.kernel
def read(field: ti.template(), i: ti.i32) -> ti.f32:
    return field[i]

@ti.kernel
def write(field: ti.template(), i: ti.i32):
    field[i] = 1.0

@ti.kernel
def add(array: ti.types.ndarray(dtype=ti.f32, ndim=2), i: ti.i32):
    ti.atomic_add(array[2, i], 1.0)

@ti.kernel
def local(i: ti.i32) -> ti.f32:
    lanes = ti.Vector([0.0 for _ in range(8)])
    lanes[3] = 1.0
    return lanes[i]

@ti.kernel
def mixed(code: ti.u64) -> ti.u64:
    return code * ti.u64(1099511628211)

for name, call, good, bad in (
    ("real function", lambda i: real(field, rows, i), 9, (10, -1, 2**31 - 1)),
    ("read", lambda i: read(field, i), 9, (10, -1)),
    ("write", lambda i: write(field, i), 9, (10, -1)),
    ("array", lambda i: add(array, i), 3, (4,)),
    ("local vector", local, 7, (8,)),
):
    call(good)
    for index in bad:
        try:
            call(index)
        except ti.TaichiAssertionError:
            continue
        print(name, index, "was not caught")
mixed(2**63 + 1)  # a hash may overflow, and says nothing

corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0.5]])
triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 4, 2], [4, 3, 2], [0, 3, 4]]
MeshShape((corners, triangles), cell=0.04, cache=False)
"""


def test_where_it_is_asked_for_every_wrong_index_is_caught(tmp_path):
    """And none in the grid of a mesh with a sliver that stands upright."""
    script = tmp_path / "checked.py"  # Taichi reads the source of kernels
    script.write_text(CHECKED)
    program = "import runpy, sys; runpy.run_path(sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", program, str(script)],
        env={**os.environ, "TAICHI_SOFT_DEBUG": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
