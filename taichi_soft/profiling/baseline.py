"""Compile the C++ reference on this machine, and run it on the same arrays in the same order as the Taichi
kernels.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.layout import BodyArrays, BondArrays
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.errors import DeviceError
from taichi_soft.core.runtime import with_usual_floats

SOURCE = Path(__file__).with_name("baseline.cpp")
RELAXED = (
    *("-fno-math-errno", "-fno-signed-zeros", "-fno-trapping-math", "-fassociative-math"),
    *("-freciprocal-math", "-ffinite-math-only"),
)
"""Flags that -ffast-math implies. With -ffast-math itself, GCC would also turn on flush-to-zero in the
thread that loads the library, and scipy's trees would then crash the process."""

FLAGS = ("-O3", "-march=native", *RELAXED, "-shared", "-fPIC", "-std=c++17")
"""Compiler options. Like Taichi's kernels, the code is for this processor and uses relaxed rounding."""

NO_FLOOR = -1.0e9


def find_compiler() -> str | None:
    """Find a C++ compiler: $CXX, g++, clang++ or c++."""
    for name in (os.environ.get("CXX", ""), "g++", "clang++", "c++"):
        if name and shutil.which(name):
            return name
    return None


def compile_baseline() -> ctypes.CDLL:
    """Compile and load the reference. Raises: DeviceError without a C++ compiler, or if the compilation
    fails.
    """
    compiler = find_compiler()
    if compiler is None:
        raise DeviceError("no C++ compiler found: install g++ or clang++, or name one in CXX")
    # The file can be deleted once the library is loaded, except on Windows, which locks it.
    with tempfile.TemporaryDirectory(prefix="taichi-soft-", ignore_cleanup_errors=True) as folder:
        library = Path(folder) / "baseline.so"
        command = [compiler, *FLAGS, str(SOURCE), "-o", str(library)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            said = done.stderr.strip().splitlines() or ["no message"]
            raise DeviceError(f"{compiler} cannot compile the baseline: {said[0]}")
        return ctypes.CDLL(str(library))


class Baseline:
    """A body that the C++ reference steps."""

    def __init__(self, library: ctypes.CDLL, body: BodyArrays) -> None:
        """Copy the arrays of `body`, in the order of the kernels. The law of `body` must be virial, springs
        or volume springs.
        """
        self._run = library.run_substeps if body.bonds is None else library.run_spring_substeps
        self._run.restype = None
        self.positions = body.rest_position.astype(np.float32)
        self.velocities = np.zeros_like(self.positions)
        elements = _tet_arrays(body) if body.bonds is None else _spring_arrays(body, body.bonds)
        self._arrays: list[NDArray[np.generic]] = [
            self.positions,
            self.velocities,
            np.zeros_like(self.positions),
            (1.0 / body.mass).astype(np.float32),
            *elements,
        ]
        # Springs without volume use no tetrahedra.
        looks_at_tets = body.bonds is None or body.bonds.expansion_modulus is not None
        tets = len(body.tet_vertices) if looks_at_tets else 0
        self._counts = [ctypes.c_int(n) for n in (len(body.mass), tets, len(body.edge_vertices))]

    @with_usual_floats
    def step(self, substeps: int, h: float) -> None:
        """Run `substeps` substeps of `h` [s] in free fall."""
        pointers = [rows.ctypes.data_as(ctypes.c_void_p) for rows in self._arrays]
        numbers = [ctypes.c_float(x) for x in (h, -GRAVITY_EARTH, NO_FLOOR)]
        self._run(*self._counts, *pointers, *numbers, ctypes.c_int(substeps))


def _tet_arrays(body: BodyArrays) -> list[NDArray[np.generic]]:
    return [
        np.ascontiguousarray(body.tet_vertices, dtype=np.int32),
        np.ascontiguousarray(body.rest_inverse, dtype=np.float32),
        np.ascontiguousarray(body.lame, dtype=np.float32),
        np.ascontiguousarray(body.edge_vertices, dtype=np.int32),
        body.edge_damping.astype(np.float32),
    ]


def _spring_arrays(body: BodyArrays, bonds: BondArrays) -> list[NDArray[np.generic]]:
    return [
        np.ascontiguousarray(body.tet_vertices, dtype=np.int32),
        np.linalg.det(body.rest_inverse).astype(np.float32),
        body.expansion_modulus.astype(np.float32),
        np.ascontiguousarray(body.tet_edges, dtype=np.int32),
        np.ascontiguousarray(body.edge_vertices, dtype=np.int32),
        bonds.constants[:, 0].astype(np.float32),
        bonds.constants[:, 1].astype(np.float32),
        bonds.constants[:, 2].astype(np.float32),
        body.edge_damping.astype(np.float32),
        np.zeros(len(body.edge_vertices), dtype=np.float32),
    ]
