"""Cells halved along limbs and sheets that would be left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.connected import parts_of
from taichi_soft.cages.graded import GradedLattice, balanced, doubled
from taichi_soft.cages.lattice import Lattice
from taichi_soft.cages.solid import Solid
from taichi_soft.cages.thin import ROD, LeftOut
from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

REFINE = 1
"""Octaves at most, unless asked for otherwise: each halves the stable step."""

SHEET = 0.003
"""Part of the cubes round a limb that is solid, from which on it is kept: of sheets far less thick."""

TRACE = 1e-3
"""Part of a voxel that is solid where only the surface tells that something is there."""


def traced(solid: Solid, points: FloatArray) -> tuple[Solid, Bools]:
    """With something in every voxel that holds one of some points of the surface, and which these are.

    Args: points: (k, 3) [m].
    """
    shape = solid.fill.shape
    places = (points - solid.origin) / solid.spacing
    voxel = np.clip(places.astype(np.int64), 0, np.array(shape) - 1)
    flat = np.ravel_multi_index(tuple(voxel.T), shape)
    held, row = np.unique(flat, return_inverse=True)
    counts = np.bincount(row.reshape(-1))
    means = np.stack([np.bincount(row.reshape(-1), places[:, k]) / counts for k in range(3)], axis=1)
    kept = np.zeros(shape, dtype=np.bool_)
    kept.reshape(-1)[held] = True
    is_new = solid.fill.reshape(-1)[held] < TRACE
    new = np.unravel_index(held[is_new], shape)
    fill, center, surface = solid.fill.copy(), solid.center.copy(), solid.surface.copy()
    fill[new] = TRACE
    center[new] = means[is_new] - np.stack(new, axis=1)
    surface[new] = solid.origin + solid.spacing * means[is_new]
    return replace(solid, fill=fill, center=center, surface=surface), kept


def octaves_for(lattice: Lattice, solid: Solid, lost: LeftOut, refine: int) -> Ints:
    """How often each cube is to be halved so that what is lost is kept, of the shape of the lattice: 0 for
    those without, and where `refine` times are not enough."""
    parts = parts_of(lost.cubes.astype(np.float64))
    count = int(parts.max(initial=-1)) + 1
    thickness, needed = np.full(count, np.inf), np.zeros(count + 1, dtype=np.int64)
    np.minimum.at(thickness, parts[lost.cubes], lost.thickness[lost.cubes])
    points, volumes = solid.quadrature()
    limbs = np.where(lost.bare, parts, -1)
    limb = limbs.reshape(-1)[_cubes_at(lattice, 0, points)]
    volume = np.bincount(limb[limb >= 0], volumes[limb >= 0], count)
    for octave in range(refine, 0, -1):
        edge = lattice.edge / 2**octave
        held = np.unique(_cubes_at(lattice, octave, lost.points))
        cubes = np.bincount(doubled(limbs, octave).reshape(-1)[held] + 1, minlength=count + 1)[1:]
        fill = volume / (np.maximum(cubes, 1) * edge**3)
        needed[:-1][(ROD * thickness >= edge) | (fill >= SHEET)] = octave
    return np.asarray(needed[parts])  # the last one's is 0


def refined(lattice: Lattice, octaves: Ints, points: FloatArray) -> Lattice | GradedLattice:
    """With cubes halved round some points.

    Args:
        octaves: how often, of the shape of the lattice.
        points: (k, 3) [m].
    """
    if not octaves.any():
        return lattice
    splits = [octaves > 0]
    for octave in range(1, int(octaves.max())):
        held = np.zeros(tuple(2**octave * n for n in lattice.cubes), dtype=np.bool_)
        held.reshape(-1)[_cubes_at(lattice, octave, points)] = True
        splits.append(doubled(octaves > octave, octave) & held)
    return GradedLattice(lattice, balanced(splits))


def _cubes_at(lattice: Lattice, octave: int, points: FloatArray) -> Ints:
    """Number of the cube of an octave that holds each point, (k,)."""
    shape = tuple(2**octave * n for n in lattice.cubes)
    cubes = ((points - lattice.origin) / (lattice.edge / 2**octave)).astype(np.int64)
    return np.asarray(np.ravel_multi_index(tuple(np.clip(cubes, 0, np.array(shape) - 1).T), shape))
