"""What turns a flipped tetrahedron right side out again.

Hooke's laws lose their hold on a tetrahedron pressed flat: their forces are stress times deformed area, and
there only the area across the thinnest axis is left. Behind it they would have nothing to go on with. So a
flipped tetrahedron follows an energy of its own, psi = M/2 |F - R|^2, with R the rotation nearest to F and M the
modulus of pressure waves, lambda + 2 mu: it draws each vertex straight to where it belongs, is zero at the
shape at rest only, and its force adds no energy. (Corotated elasticity without lateral contraction, which would
draw what is stretched along one axis further inside out along another.)

Where a tetrahedron turns over its force jumps: `kernels.flips` says what that asks for.
"""

from taichi_soft.math.svd import signed_svd
from taichi_soft.math.tensors import plus, product, transposed
from taichi_soft.runtime import ti


@ti.func
def recovering_piola(F, modulus):
    """P = M (F - R) [Pa], as columns, of F with a negative determinant."""
    U, _, V = signed_svd(F)
    return plus(F, modulus, product(U, transposed(V)), -modulus)
