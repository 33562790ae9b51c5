"""Signed distance of a point from any solid."""

from taichi_soft.contact.distances.box import box_distance
from taichi_soft.contact.distances.capsule import capsule_distance
from taichi_soft.contact.distances.height_field import height_field_distance
from taichi_soft.contact.distances.mesh import mesh_distance
from taichi_soft.contact.distances.plane import plane_distance
from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.distances.sphere import sphere_distance
from taichi_soft.core.runtime import ti

_Vector8 = ti.types.vector(8, ti.f32)


@ti.real_func
def _grid_distance(
    samples: ti.template(),
    kind: ti.i32,
    parameters: _Vector8,
    resolution: ti.math.ivec3,
    offset: ti.i32,
    x: ti.math.vec3,
) -> ti.math.vec4:
    """Return the normal (x, y, z) and the signed distance (w) [m] from a solid with a grid.

    This is a `real_func`, so that its code is not copied to each call: it is longer than the code of all
    other solids together.
    """
    distance, normal = ti.cast(0.0, ti.f32), ti.Vector.zero(ti.f32, 3)
    if kind == ShapeKind.MESH:
        distance, normal = mesh_distance(samples, parameters, resolution, offset, x)
    else:
        distance, normal = height_field_distance(samples, parameters, resolution, offset, x)
    return ti.Vector([normal.x, normal.y, normal.z, distance])


@ti.func
def signed_distance(samples: ti.template(), kind, parameters, resolution, offset, x):
    """Return the signed distance of a point from a solid, and the unit normal of the surface.

    The distance is exact for planes, spheres, boxes and capsules. For height fields and meshes, the distance
    is a lower bound by which a ray can always advance: see `height_field_distance` and `mesh_distance`.
    Args:
        samples: f32 field with the grids of all solids, one after the other.
        kind: a `ShapeKind`.
        parameters: vec8, described at the distance function of each kind.
        resolution: number of nodes of the solid's grid along each axis, ivec3.
        offset: row of the solid's first sample in `samples`.
        x: point in the frame of the solid, f32 [m].
    Returns: distance [m], negative inside; outward normal, of length 1 for every `x`.
    """
    distance, normal = plane_distance(parameters, x)
    if kind == ShapeKind.SPHERE:
        distance, normal = sphere_distance(parameters, x)
    elif kind == ShapeKind.BOX:
        distance, normal = box_distance(parameters, x)
    elif kind == ShapeKind.CAPSULE:
        distance, normal = capsule_distance(parameters, x)
    elif kind == ShapeKind.HEIGHT_FIELD or kind == ShapeKind.MESH:
        found = _grid_distance(samples, kind, parameters, resolution, offset, x)
        distance, normal = found.w, found.xyz
    return distance, normal
