"""Tetrahedra that carry the solid inside a surface.

A lattice cage (`cage`) needs no other package:

1. Rays along three axes find the part of each voxel that is inside (`solid`).
2. Tetrahedra of a body-centred lattice are selected to cover each component of the solid (`marking`).
3. The outer vertices of these tetrahedra move onto the surface, as far as all tetrahedra stay well shaped
   (`fitting`).
4. For each tetrahedron, the solid fraction is computed. The vertices get masses that have the inertia of the
   solid (`cage`).
5. Limbs and sheets that the cage misses (`thin`) get smaller cells (`refinement`, `graded`).

External programs (`mesher`) fill the surface with tetrahedra that are solid throughout.
"""

from taichi_soft.cages.cage import Cage
from taichi_soft.cages.lattice_cage import build_cage
from taichi_soft.cages.methods import tetrahedra_of

__all__ = ["Cage", "build_cage", "tetrahedra_of"]
