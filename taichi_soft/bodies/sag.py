"""Check that bodies are stiff enough for their own weight."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.core.errors import TooSoftWarning
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh

MAX_SAG = 0.2
"""Largest ratio density * g * height / E without a warning. In softer bodies, tetrahedra invert when the
body stands or lands. The value was found by dropping four shapes of 1 m from a height of 2 m, with three
Poisson's ratios up to 0.45."""


def sag(asset: SoftBodyAsset, gravity: float) -> float:
    """Return the ratio density * g * height / E of a body, with g = `gravity` [m/s^2].

    The ratio is zero for bodies without tetrahedra, for anisotropic materials, and if all vertices are
    pinned. The height is the smallest extent of the mesh along x, y or z, so the orientation of the body in
    the world has no effect.
    """
    mesh, material = asset.mesh, asset.description.material
    is_pinned = len(asset.description.pinned) == len(mesh.vertices)
    if is_pinned or not (isinstance(mesh, TetMesh) and isinstance(material, Material)):
        return 0.0
    solid = mesh.volumes * mesh.fill  # volume without the empty part of each tetrahedron
    weights = solid / solid.sum()
    softness = weights @ (mesh.fill / asset.description.per_tet("young"))
    density = weights @ (asset.description.per_tet("density") / mesh.fill)
    return float(density * gravity * np.ptp(mesh.vertices, axis=0).min() * softness)


def _rounded_up(number: float) -> float:
    """Round a positive number up to two significant digits."""
    step = 10.0 ** (np.floor(np.log10(number)) - 1)
    return float(np.ceil(number / step) * step)


def review_weight(assets: Iterable[SoftBodyAsset], gravity: NDArray[np.float64]) -> None:
    """Warn if a body is too soft for its weight, and suggest a modulus. Call it before building a world."""
    acceleration = float(np.linalg.norm(gravity))
    worst = max(assets, key=lambda asset: sag(asset, acceleration))
    found = sag(worst, acceleration)
    if found > MAX_SAG:
        assert isinstance(worst.mesh, TetMesh)
        young = np.mean(worst.description.per_tet("young") / worst.mesh.fill)
        warnings.warn(
            f"a body is too soft for its weight: {worst!r} puts {found * young:.3g} Pa on its base, and "
            f"its Young's modulus is {young:.3g} Pa. It can end flat and partly inverted. Use a "
            f"modulus of {_rounded_up(young * found / MAX_SAG):.2g} Pa, less gravity or a smaller body",
            TooSoftWarning,
            stacklevel=5,  # the caller of World.build
        )
