"""Current constants of a body's law. While a material changes, they are between the old and new constants."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody, record_of
from taichi_soft.elements.laws.rod import Rods
from taichi_soft.elements.laws.shell import Shells
from taichi_soft.elements.materials import isotropic_stiffness

Floats = NDArray[np.float64]


def lame_of(body: SoftBody) -> Floats:
    """Return the current Lame constants lambda and mu of each tetrahedron, (m, 2) [Pa].

    They are zero if the material is anisotropic.
    """
    record = record_of(body)
    if record.present is None:
        return record.description.lame
    return record.present.lame[np.argsort(record.present.tet_order)]


def stiffness_of(body: SoftBody) -> Floats:
    """Return the current stiffness C of Hooke's law for each tetrahedron, (m, 6, 6) [Pa]."""
    record = record_of(body)
    if record.present is None:
        return record.description.stiffness_matrices()
    if not record.present.stiffness.any():
        return isotropic_stiffness(*lame_of(body).T)
    upper = record.present.stiffness[np.argsort(record.present.tet_order)]
    matrices = np.zeros((len(upper), 6, 6))
    rows, columns = np.triu_indices(6)
    matrices[:, rows, columns] = matrices[:, columns, rows] = upper
    return matrices


def shells_of(body: SoftBody) -> Shells:
    """Return the current constants of the triangles of a shell, in the caller's order."""
    record = record_of(body)
    shells, present = record.description.shells, record.present
    assert shells is not None
    if present is None or present.shells is None:
        return shells
    back = np.argsort(present.shells.order)
    return replace(shells, lame=present.shells.lame[back], bending=present.shells.bending[back])


def rods_of(body: SoftBody) -> Rods:
    """Return the current constants of the edges and joints of a rod."""
    record = record_of(body)
    present = record.present
    rods = record.description.rods if present is None else present.rods
    assert rods is not None
    return rods


def edge_constants_of(body: SoftBody) -> Floats:
    """Return the current `Bonds.constants` of each edge of a body with a pairwise law, (k, 4)."""
    record = record_of(body)
    bonds, present = record.description.bonds, record.present
    if present is not None and present.bonds is not None:
        return present.bonds.constants[np.argsort(present.edge_order)]
    assert bonds is not None
    return bonds.constants
