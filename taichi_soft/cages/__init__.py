"""From the surface of a solid to tetrahedra that carry it.

1. Which part of each voxel is inside (`solid`): lines through the surface, along three axes.
2. Which tetrahedra of a body-centred lattice carry it (`marking`), part by part.
3. Their outer vertices move onto the surface, as far as every tetrahedron stays good (`fitting`).
4. What of the solid each tetrahedron carries, and masses of the vertices with its inertia (`cage`).
"""

from taichi_soft.cages.cage import Cage, CageMethod, build_cage

__all__ = ["Cage", "CageMethod", "build_cage"]
