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
    """Normal and distance from a solid with a grid. A separate function, because it is more code than all
    other solids.
    """
    distance, normal = ti.cast(0.0, ti.f32), ti.Vector.zero(ti.f32, 3)
    if kind == ShapeKind.MESH:
        distance, normal = mesh_distance(samples, parameters, resolution, offset, x)
    else:
        distance, normal = height_field_distance(samples, parameters, resolution, offset, x)
    return ti.Vector([normal.x, normal.y, normal.z, distance])


@ti.func
def signed_distance(samples: ti.template(), kind, parameters, resolution, offset, x):
    """Distance of a point from the surface of a solid, negative inside, and the outward unit normal there.

    Exact for plane, sphere, box and capsule. For the others it never exceeds the distance, so that a ray can
    always advance by it: see `height_field_distance` and `mesh_distance`.
    Args:
        samples: f32 field with the grids of all solids, one after the other.
        kind: a `ShapeKind`.
        parameters: vec8, see the function of each kind.
        resolution: ivec3, nodes of the solid's grid along each axis.
        offset: row of its first sample in `samples`.
        x: the point in the solid's own frame, f32 [m].
    Returns: distance [m] and normal, of length 1 for every x.
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
