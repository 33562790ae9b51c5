"""Halve cells along limbs and sheets that a cage would miss."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.connected import parts_of
from taichi_soft.cages.graded import GradedLattice, balanced, doubled
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.solid import Solid
from taichi_soft.cages.thin import MAX_ROD_RATIO, MissedParts
from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

REFINE = 1
"""Default largest number of times that cells are halved at thin limbs and sheets. Each halving halves the
stable step."""

MIN_SHEET_FILL = 0.003
"""The cage keeps a limb or sheet that is far thinner than a cube if at least this fraction of the cubes
around it is solid."""

TRACE = 1e-3
"""Smallest fill of a voxel that contains a point of the surface. Rays can miss the solid in such a voxel."""


def traced(solid: Solid, points: FloatArray) -> tuple[Solid, Bools]:
    """Raise the fill of every voxel that contains a point of the surface to at least `TRACE`.

    Args: points: points of the surface, (k, 3) [m].
    Returns: the new solid, and True for voxels with a point, with the shape of `solid.fill`.
    """
    shape = solid.fill.shape
    coordinates = (points - solid.origin) / solid.spacing
    voxel = np.clip(coordinates.astype(np.int64), 0, np.array(shape) - 1)
    flat = np.ravel_multi_index(tuple(voxel.T), shape)
    occupied, row = np.unique(flat, return_inverse=True)
    counts = np.bincount(row.reshape(-1))
    means = np.stack([np.bincount(row.reshape(-1), coordinates[:, k]) / counts for k in range(3)], axis=1)
    kept = np.zeros(shape, dtype=np.bool_)
    kept.reshape(-1)[occupied] = True
    is_new = solid.fill.reshape(-1)[occupied] < TRACE
    new = np.unravel_index(occupied[is_new], shape)
    fill, center, surface = solid.fill.copy(), solid.center.copy(), solid.surface.copy()
    fill[new] = TRACE
    center[new] = means[is_new] - np.stack(new, axis=1)
    surface[new] = solid.origin + solid.spacing * means[is_new]
    return replace(solid, fill=fill, center=center, surface=surface), kept


def octaves_for(lattice: Lattice, solid: Solid, missed: MissedParts, refine: int) -> Ints:
    """Return how often each cube must be halved to keep the missed parts, with the shape `lattice.cubes`.

    The number is 0 for cubes without missed parts, and for parts that `refine` halvings do not keep.
    """
    parts = parts_of(missed.cubes.astype(np.float64))
    count = int(parts.max(initial=-1)) + 1
    thickness, needed = np.full(count, np.inf), np.zeros(count + 1, dtype=np.int64)
    np.minimum.at(thickness, parts[missed.cubes], missed.thickness[missed.cubes])
    points, volumes = solid.quadrature()
    limbs = np.where(missed.bare, parts, -1)
    limb = limbs.reshape(-1)[_cubes_at(lattice, 0, points)]
    volume = np.bincount(limb[limb >= 0], volumes[limb >= 0], count)
    for octave in range(refine, 0, -1):
        edge = lattice.edge / 2**octave
        occupied = np.unique(_cubes_at(lattice, octave, missed.points))
        cubes = np.bincount(doubled(limbs, octave).reshape(-1)[occupied] + 1, minlength=count + 1)[1:]
        fill = volume / (np.maximum(cubes, 1) * edge**3)
        needed[:-1][(MAX_ROD_RATIO * thickness >= edge) | (fill >= MIN_SHEET_FILL)] = octave
    return np.asarray(needed[parts])  # cubes without missed parts have index -1, the last entry, which is 0


def refined(lattice: Lattice, octaves: Ints, points: FloatArray) -> Lattice | GradedLattice:
    """Return the lattice with cubes halved around some points.

    Args:
        octaves: number of halvings of each cube, with the shape `lattice.cubes`.
        points: (k, 3) [m].
    """
    if not octaves.any():
        return lattice
    splits = [octaves > 0]
    for octave in range(1, int(octaves.max())):
        occupied = np.zeros(tuple(2**octave * n for n in lattice.cubes), dtype=np.bool_)
        occupied.reshape(-1)[_cubes_at(lattice, octave, points)] = True
        splits.append(doubled(octaves > octave, octave) & occupied)
    return GradedLattice(lattice, balanced(splits))


def _cubes_at(lattice: Lattice, octave: int, points: FloatArray) -> Ints:
    """Return the flat index of the cube that contains each point, (k,). Cubes are halved `octave` times."""
    shape = tuple(2**octave * n for n in lattice.cubes)
    cubes = ((points - lattice.origin) / (lattice.edge / 2**octave)).astype(np.int64)
    return np.asarray(np.ravel_multi_index(tuple(np.clip(cubes, 0, np.array(shape) - 1).T), shape))
