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
"""Kinds of springs in a cloth. The values are the steps over the grid, (columns, rows), from one end of a
spring to the other end."""


def rope(length: float, segments: int, mass: float) -> ParticleMesh:
    """Make a chain of particles along x, centred at the origin. Vertex 0 is the end at the lowest x.

    Args:
        length: total length [m].
        segments: number of springs.
        mass: total mass [kg]. The particles at the ends have half the mass of the other particles.
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
    """Make a rectangular cloth in the x-y plane, centred at the origin.

    Vertex i * (cells[1] + 1) + j lies at column i and row j. Vertex 0 is the corner at the lowest x and y.
    Args:
        size: (2,) lengths along x and y [m].
        cells: number of cells along x and y.
        mass: total mass [kg], distributed by the area around each particle.
        springs: kinds of springs: "tensile" along the threads, "shear" along the diagonals of the cells,
            "bend" over two cells.
    Raises: OptionError for a number out of range or an unknown kind.
    """
    width, height = as_array(size, "size", (2,), "m")
    for value in (width, height):
        as_positive(value, "size", "m")
    nx, ny = as_cells(cells)
    if not isinstance(springs, (tuple, list)) or not set(springs) <= set(KINDS) or not springs:
        raise OptionError(f"springs must be some of {', '.join(map(repr, KINDS))}, got {springs!r}")
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="ij"))
    vertices = np.stack([(i - nx / 2) * (width / nx), (j - ny / 2) * (height / ny), 0.0 * i], axis=1)
    pairs = []
    for di, dj in (step for kind in springs for step in KINDS[kind]):
        fits = (i + di <= nx) & (j + dj <= ny) & (j + dj >= 0)
        first = np.flatnonzero(fits)
        pairs.append(np.stack([first, first + di * (ny + 1) + dj], axis=1))
    weight = np.where((i == 0) | (i == nx), 0.5, 1.0) * np.where((j == 0) | (j == ny), 0.5, 1.0)
    masses = as_positive(mass, "mass", "kg") * weight / (nx * ny)
    corner = np.flatnonzero((i < nx) & (j < ny))
    a, b, c, d = corner, corner + ny + 1, corner + ny + 2, corner + 1
    front = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return ParticleMesh(
        vertices, np.concatenate(pairs), masses, surface=np.concatenate([front, front[:, ::-1]])
    )


def cloth_constants(mesh: ParticleMesh, cells: tuple[int, int], **values: float) -> FloatArray:
    """Return a value for each spring of a cloth, such as the stiffness, (k,), by the kind of the spring.

    Args:
        mesh: result of `cloth`.
        cells: number of cells along x and y, as passed to `cloth`.
        values: one value of 0 or more for each kind of spring in the cloth: tensile=, shear=, bend=.
    Raises: OptionError for an unknown or missing kind; MeshError for a mesh with other cells.
    Example:
        sheet = cloth((1.0, 1.0), (10, 10), mass=0.3)
        stiffness = cloth_constants(sheet, (10, 10), tensile=200, shear=100, bend=5)  # N/m
        threads = SpringMaterial(stiffness, damping=0.3)
    """
    unknown = set(values) - set(KINDS)
    if unknown:
        raise OptionError(f"unknown spring kind {min(unknown)!r}: choose from {', '.join(map(repr, KINDS))}")
    nx, ny = as_cells(cells)
    kind = _kinds(mesh, nx, ny)
    chosen = np.zeros(len(mesh.edges))
    for number, name in enumerate(KINDS):
        if (kind == number).any():
            if name not in values:
                raise OptionError(f"the cloth has {name} springs: pass {name}= too, 0 for none")
            chosen[kind == number] = as_number(values[name], name, 0.0, np.inf, "a number of 0 or more")
    return chosen


def as_cells(cells: Any) -> tuple[int, int]:
    """Check the numbers of cells along two axes, and return them. Raises: OptionError."""
    if not isinstance(cells, (tuple, list)) or len(cells) != 2:
        raise OptionError(f"cells must be two whole numbers, got {cells!r}")
    return as_count(cells[0], "cells"), as_count(cells[1], "cells")


def _kinds(mesh: ParticleMesh, nx: int, ny: int) -> NDArray[np.int64]:
    """Return the index in `KINDS` of each spring's kind, (k,). Raises: MeshError if cells do not match."""
    if not isinstance(mesh, ParticleMesh):
        raise MeshError(f"mesh must be a ParticleMesh made by cloth, got {type(mesh).__name__}")
    if len(mesh.vertices) != (nx + 1) * (ny + 1):
        raise MeshError(
            f"a cloth of ({nx}, {ny}) cells has {(nx + 1) * (ny + 1)} vertices, not {len(mesh.vertices)}: "
            "pass the cells it was made with"
        )
    i, j = np.divmod(mesh.edges, ny + 1)
    step = np.stack([i[:, 1] - i[:, 0], j[:, 1] - j[:, 0]], axis=1)
    kind = np.full(len(step), -1)
    for number, steps in enumerate(KINDS.values()):
        kind[np.any([(step == each).all(axis=1) for each in steps], axis=0)] = number
    if kind.min() < 0:
        row = int(kind.argmin())
        raise MeshError(
            f"edge {row} is not a spring of a cloth of ({nx}, {ny}) cells: pass the cells it was made with"
        )
    return kind


def edges_as_particles(mesh: TetMesh, density: float | NDArray[np.float64]) -> ParticleMesh:
    """Make particles and springs from a solid's vertices and edges.

    Each particle gets a quarter of the mass of each tetrahedron around it.

    Args:
        density: density [kg/m^3], one number or one for each tetrahedron.
        mesh: tetrahedra, whose vertices become the particles.
    Raises: MeshError if `mesh` is not a TetMesh; OptionError for a density that is not positive or has
        another shape.
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
