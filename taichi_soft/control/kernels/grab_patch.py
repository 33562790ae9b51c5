"""Find the patch of a grab, in float64: the part of a body that the grab pulls."""

from taichi_soft.control.kernels.grabs import PATCH_ROWS
from taichi_soft.core.math.rows import row_at
from taichi_soft.core.runtime import ti


@ti.func
def dot(a, b):
    """Scalar product of two vectors, with a fixed order of summation."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@ti.func
def _count_within(patch: ti.template(), distance):
    count = 0
    for v in range(patch.shape[0]):
        count += int(patch[v, 0] <= distance)
    return count


@ti.func
def _distance_of_last(patch: ti.template(), radius):
    """Find by bisection the smallest distance within which there are more vertices than a patch can have.

    The bisection runs on the bits of the floats, because the bits of non-negative floats, read as integers,
    have the same order as the floats.
    """
    lowest, highest = ti.cast(0, ti.i64), ti.bit_cast(radius, ti.i64)
    while lowest < highest:
        middle = lowest + ((highest - lowest) >> 1)
        if _count_within(patch, ti.bit_cast(middle, ti.f64)) > PATCH_ROWS:
            highest = middle
        else:
            lowest = middle + 1
    return ti.bit_cast(lowest, ti.f64)


@ti.func
def _square_of_slope(x: ti.template(), elements: ti.template(), patch: ti.template(), e):
    """Return the squared gradient of the falloff in a tetrahedron.

    For a spring, return the squared difference of the falloff between the ends.
    """
    first = elements[e, 0]
    rise, is_near = ti.Vector.zero(ti.f64, 3), patch[first, 0] != 0.0
    for i in ti.static(range(3)):
        if i + 1 < elements.shape[1]:
            rise[i] = patch[elements[e, i + 1], 0] - patch[first, 0]
            is_near = is_near or patch[elements[e, i + 1], 0] != 0.0
    square = rise.x * rise.x
    if elements.shape[1] == 4 and is_near:
        start = row_at(x, first, 0)
        a, b, c = row_at(x, elements[e, 1], 0), row_at(x, elements[e, 2], 0), row_at(x, elements[e, 3], 0)
        a, b, c = a - start, b - start, c - start
        bc, ca, ab = b.cross(c), c.cross(a), a.cross(b)
        slope = (rise.x * bc + rise.y * ca + rise.z * ab) / dot(a, bc)
        square = dot(slope, slope)
    return square


@ti.kernel
def shape_patch(
    corners: ti.types.ndarray(dtype=ti.i32, ndim=1),
    weights: ti.types.ndarray(dtype=ti.f64, ndim=1),
    limits: ti.types.ndarray(dtype=ti.f64, ndim=1),
    x: ti.types.ndarray(dtype=ti.f64, ndim=2),
    masses: ti.types.ndarray(dtype=ti.f64, ndim=1),
    elements: ti.types.ndarray(dtype=ti.i32, ndim=2),
    stiffness: ti.types.ndarray(dtype=ti.f64, ndim=1),
    patch: ti.types.ndarray(dtype=ti.f64, ndim=2),
    strength: ti.types.ndarray(dtype=ti.f64, ndim=1),
):
    """Find the patch around a point at rest, and its strength.

    The strength is the product of `FARTHEST_PULL`, the radius and the stiffness of the patch. The stiffness
    is the force divided by the displacement, if each vertex moves in proportion to its falloff w. It is the
    sum of V mu |grad w|^2 over all tetrahedra, or of k (w_i - w_j)^2 / 3 over all springs. This sum is twice
    the energy of the deformation divided by the squared displacement.

    Args:
        corners: three or four vertices between which the point lies.
        weights: barycentric coordinates of the point in `corners`.
        limits: constants `control.grab_patch.LIMITS`.
        x: positions of the vertices at rest, (n, 3) [m].
        masses: masses of the vertices, (n,) [kg].
        elements: vertices of springs (e, 2) or tetrahedra (e, 4).
        stiffness: stiffness of each element, k / 3 [N/m] or V mu [N m], (e,).
        patch: (n, 2), receives the falloff of each vertex, 0 outside the patch, and the vertex's fraction of
            the force.
        strength: (1,), receives the strength [N].
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        point, lower, upper = ti.Vector.zero(ti.f64, 3), row_at(x, 0, 0), row_at(x, 0, 0)
        for i in range(corners.shape[0]):
            point += weights[i] * row_at(x, corners[i], 0)
        for v in range(x.shape[0]):
            lower, upper = ti.min(lower, row_at(x, v, 0)), ti.max(upper, row_at(x, v, 0))
            arm = row_at(x, v, 0) - point
            patch[v, 0] = ti.sqrt(dot(arm, arm))
        farthest, size = ti.cast(0.0, ti.f64), upper - lower
        for i in range(corners.shape[0]):
            farthest = ti.max(farthest, patch[corners[i], 0])
        radius = ti.max(limits[0] * ti.sqrt(dot(size, size)), limits[1] * farthest)
        if _count_within(patch, radius) > PATCH_ROWS:
            radius = _distance_of_last(patch, radius)
        total = ti.cast(0.0, ti.f64)
        for v in range(x.shape[0]):
            part = patch[v, 0] / radius
            left = ti.max(1.0 - part * part, 0.0)
            falloff = left * left
            falloff = ti.select(falloff >= limits[2], falloff, 0.0)
            patch[v, 0], patch[v, 1] = falloff, falloff * masses[v]
            total += falloff * masses[v]
        for v in range(x.shape[0]):
            patch[v, 1] = patch[v, 1] / total
        held = ti.cast(0.0, ti.f64)
        for e in range(stiffness.shape[0]):
            held += stiffness[e] * _square_of_slope(x, elements, patch, e)
        strength[0] = limits[3] * radius * held
