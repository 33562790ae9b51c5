"""Whether bodies bear their own weight."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.core.errors import TooSoftWarning
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh

MOST_SAG = 0.2
"""Weight of a column as high as a body over its Young's modulus: what is softer turns tetrahedra inside out
where it stands or lands. Four shapes of a metre with three Poisson's ratios up to 0.45, dropped from 2 m: at
0.15 none of the twelve does, at 0.2 two, at 0.5 five, at 0.8 seven."""


def sag(asset: SoftBodyAsset, gravity: float) -> float:
    """density * g * height / E of a body, `gravity` in m/s^2; zero for materials that have no such E, and for
    bodies that are pinned altogether.

    The height is the least extent of the mesh along its axes, so that it counts however the body lies.
    """
    mesh, material = asset.mesh, asset.description.material
    is_held = len(asset.description.pinned) == len(mesh.vertices)
    if is_held or not (isinstance(mesh, TetMesh) and isinstance(material, Material)):
        return 0.0
    solid = mesh.volumes * mesh.fill  # whose constants are those of the material, however little it fills
    shares = solid / solid.sum()
    softness = shares @ (mesh.fill / asset.description.per_tet("young"))
    density = shares @ (asset.description.per_tet("density") / mesh.fill)
    return float(density * gravity * np.ptp(mesh.vertices, axis=0).min() * softness)


def _rounded_up(number: float) -> float:
    """Round a positive number up to two significant digits."""
    step = 10.0 ** (np.floor(np.log10(number)) - 1)
    return float(np.ceil(number / step) * step)


def review_weight(assets: Iterable[SoftBodyAsset], gravity: NDArray[np.float64]) -> None:
    """Before a world is built: say which body is too soft for its weight, and what would bear it."""
    pull = float(np.linalg.norm(gravity))
    worst = max(assets, key=lambda asset: sag(asset, pull))
    found = sag(worst, pull)
    if found > MOST_SAG:
        assert isinstance(worst.mesh, TetMesh)
        young = np.mean(worst.description.per_tet("young") / worst.mesh.fill)
        warnings.warn(
            f"a body is too soft for its weight: {worst!r} weighs {found * young:.3g} Pa at its foot, and "
            f"its Young's modulus is {young:.3g} Pa. It may end flat and partly inside out. Take a "
            f"modulus of {_rounded_up(young * found / MOST_SAG):.2g} Pa, less gravity or a smaller body",
            TooSoftWarning,
            stacklevel=5,  # who called World.build
        )
