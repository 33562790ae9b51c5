"""From the surface of a solid to tetrahedra that carry it.

A lattice (`cage`) needs no other package:

1. Which part of each voxel is inside (`solid`): lines through the surface, along three axes.
2. Which tetrahedra of a body-centred lattice carry it (`marking`), part by part.
3. Their outer vertices move onto the surface, as far as every tetrahedron stays good (`fitting`).
4. What of the solid each tetrahedron carries, and masses of the vertices with its inertia (`cage`).
5. Limbs and sheets that are left out (`thin`) get smaller cells (`refinement`, `graded`).

Programs of others (`mesher`) fill the surface with tetrahedra that are solid throughout.
"""

from taichi_soft.cages.cage import Cage
from taichi_soft.cages.lattice_cage import build_cage
from taichi_soft.cages.methods import tetrahedra_of

__all__ = ["Cage", "build_cage", "tetrahedra_of"]
