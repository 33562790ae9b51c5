"""Bodies of particles and springs: ropes, cloth, and the edges of a solid (thesis section 3.4, fig. 3.4)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array, as_count, as_number, as_positive, to_array
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.particle_mesh import ParticleMesh
from taichi_soft.meshing.tet_mesh import TetMesh

KINDS = {"tensile": ((1, 0), (0, 1)), "shear": ((1, 1), (1, -1)), "bend": ((2, 0), (0, 2))}
"""Springs of a cloth by the steps over its grid that they span."""


def rope(length: float, segments: int, mass: float) -> ParticleMesh:
    """A chain of particles along x, centred at the origin. Vertex 0 is the end at the lowest x.

    Args:
        length: of the whole [m].
        segments: number of springs.
        mass: of the whole [kg]; the ends weigh half.
    Example:
        arena = World(floor=0.0)
        line = rope(length=2.0, segments=20, mass=0.5)
        arena.add_body(line, SpringMaterial(stiffness=2000, damping=0.2), position=(0, 0, 3), pinned=[0])
    """
    count = as_count(segments, "segments")
    x = (np.arange(count + 1) - count / 2) * (as_positive(length, "length", "m") / count)
    weights = np.full(count + 1, as_positive(mass, "mass", "kg") / count)
    weights[[0, -1]] /= 2
    numbers = np.arange(count)
    vertices = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)
    return ParticleMesh(vertices, np.stack([numbers, numbers + 1], axis=1), weights)


def cloth(
    size: ArrayLike, cells: tuple[int, int], mass: float, *, springs: tuple[str, ...] = tuple(KINDS)
) -> ParticleMesh:
    """A rectangle of cloth in the x-y plane, centred at the origin.

    Vertex i (cells[1] + 1) + j lies at column i and row j. Vertex 0 is the corner at the lowest x and y.
    Args:
        size: (2,) along x and y [m].
        cells: meshes along x and y.
        mass: of the whole [kg], by the area round each particle.
        springs: of which kinds: "tensile" along the threads, "shear" across the meshes, "bend" over two.
    Raises: OptionError for a number out of range or an unknown kind.
    """
    width, height = as_array(size, "size", (2,), "m")
    for value in (width, height):
        as_positive(value, "size", "m")
    nx, ny = _as_cells(cells)
    if not isinstance(springs, (tuple, list)) or not set(springs) <= set(KINDS) or not springs:
        raise OptionError(f"springs must be some of {', '.join(map(repr, KINDS))}, got {springs!r}")
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="ij"))
    vertices = np.stack([(i - nx / 2) * (width / nx), (j - ny / 2) * (height / ny), 0.0 * i], axis=1)
    pairs = []
    for di, dj in (step for kind in springs for step in KINDS[kind]):
        fits = (i + di <= nx) & (j + dj <= ny) & (j + dj >= 0)
        first = np.flatnonzero(fits)
        pairs.append(np.stack([first, first + di * (ny + 1) + dj], axis=1))
    share = np.where((i == 0) | (i == nx), 0.5, 1.0) * np.where((j == 0) | (j == ny), 0.5, 1.0)
    masses = as_positive(mass, "mass", "kg") * share / (nx * ny)
    corner = np.flatnonzero((i < nx) & (j < ny))
    a, b, c, d = corner, corner + ny + 1, corner + ny + 2, corner + 1
    front = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return ParticleMesh(
        vertices, np.concatenate(pairs), masses, surface=np.concatenate([front, front[:, ::-1]])
    )


def cloth_constants(mesh: ParticleMesh, cells: tuple[int, int], **values: float) -> FloatArray:
    """One value for each spring of a `cloth`, (k,), such as its stiffness, by kind.

    Args:
        mesh: made by `cloth`.
        cells: as given to it.
        values: tensile=, shear= and bend=, each of the kinds that the cloth has; 0 for none.
    Raises: OptionError for an unknown kind or one that is missing; MeshError for a mesh of other cells.
    Example:
        sheet = cloth((1.0, 1.0), (10, 10), mass=0.3)
        stiffness = cloth_constants(sheet, (10, 10), tensile=200, shear=100, bend=5)  # N/m
        threads = SpringMaterial(stiffness, damping=0.3)
    """
    unknown = set(values) - set(KINDS)
    if unknown:
        raise OptionError(f"unknown spring kind {min(unknown)!r}: choose of {', '.join(map(repr, KINDS))}")
    nx, ny = _as_cells(cells)
    kind = _kinds(mesh, nx, ny)
    chosen = np.zeros(len(mesh.edges))
    for number, name in enumerate(KINDS):
        if (kind == number).any():
            if name not in values:
                raise OptionError(f"the cloth has {name} springs: give {name}= as well, 0 for none")
            chosen[kind == number] = as_number(values[name], name, 0.0, np.inf, "a number of 0 or more")
    return chosen


def _as_cells(cells: Any) -> tuple[int, int]:
    if not isinstance(cells, (tuple, list)) or len(cells) != 2:
        raise OptionError(f"cells must be two whole numbers, got {cells!r}")
    return as_count(cells[0], "cells"), as_count(cells[1], "cells")


def _kinds(mesh: ParticleMesh, nx: int, ny: int) -> NDArray[np.int64]:
    """Which of `KINDS` each spring of a cloth is, (k,). Raises: MeshError if it is a cloth of other cells."""
    if not isinstance(mesh, ParticleMesh):
        raise MeshError(f"mesh must be a ParticleMesh made by cloth, got {type(mesh).__name__}")
    if len(mesh.vertices) != (nx + 1) * (ny + 1):
        raise MeshError(
            f"a cloth of ({nx}, {ny}) cells has {(nx + 1) * (ny + 1)} vertices, not {len(mesh.vertices)}"
        )
    i, j = np.divmod(mesh.edges, ny + 1)
    step = np.stack([i[:, 1] - i[:, 0], j[:, 1] - j[:, 0]], axis=1)
    kind = np.full(len(step), -1)
    for number, steps in enumerate(KINDS.values()):
        kind[np.any([(step == each).all(axis=1) for each in steps], axis=0)] = number
    if kind.min() < 0:
        row = int(kind.argmin())
        raise MeshError(
            f"edge {row} is no spring of a cloth of ({nx}, {ny}) cells: give the cells it was made with"
        )
    return kind


def edges_as_particles(mesh: TetMesh, density: float | NDArray[np.float64]) -> ParticleMesh:
    """The particles and edges of a solid without its tetrahedra, a quarter of whose masses each gets.

    Args:
        density: [kg/m^3], one number or one per tetrahedron.
        mesh: tetrahedra, whose vertices become the particles.
    Raises: MeshError for what is no TetMesh; OptionError for a density that is not positive or does not fit.
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"mesh must be a TetMesh, got {type(mesh).__name__}")
    given = density if np.ndim(to_array(density, "density")) else np.full(len(mesh.tets), density)
    rho = as_array(given, "density", (len(mesh.tets),), "kg/m^3")
    if not (rho > 0).all():
        raise OptionError(f"density must be above 0 kg/m^3, got {rho.min():g}")
    masses = np.repeat(mesh.volumes * rho / 4.0, 4)
    per_vertex = np.bincount(mesh.tets.ravel(), masses, len(mesh.vertices))
    return ParticleMesh(mesh.vertices, mesh.edges, per_vertex, surface=mesh.surface)
