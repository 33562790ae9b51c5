"""Rotations by unit quaternions (x, y, z, w)."""

from taichi_soft.core.math.elementary import cos_sin
from taichi_soft.core.runtime import ti


@ti.func
def turned(q, v):
    """Return the vec3 `v`, rotated by the quaternion `q`."""
    axis = q.xyz
    t = 2.0 * axis.cross(v)
    return v + q.w * t + axis.cross(t)


@ti.func
def turned_back(q, v):
    """Return the vec3 `v`, rotated by the inverse of the quaternion `q`."""
    axis = q.xyz
    t = 2.0 * v.cross(axis)
    return v + q.w * t + t.cross(axis)


@ti.func
def spun(q, rotation):
    """Return the quaternion of the rotation `q`, followed by the rotation vector `rotation` [rad]."""
    angle2 = rotation.dot(rotation)
    result = q
    if angle2 > 0.0:
        angle = ti.sqrt(angle2)
        w, sine = cos_sin(0.5 * angle)
        axis = rotation * (sine / angle)
        turn = axis * q.w + q.xyz * w + axis.cross(q.xyz)
        result = ti.Vector([turn.x, turn.y, turn.z, w * q.w - axis.dot(q.xyz)])
    return result


@ti.func
def quaternion_of_axes(x, y, z):
    """Return the quaternion of the rotation that turns the axes of the world into `x`, `y` and `z`.

    See Shepperd 1978: the largest component is computed first.
    """
    trace = x.x + y.y + z.z
    q = ti.Vector([y.z - z.y, z.x - x.z, x.y - y.x, 1.0 + trace])
    if trace < ti.max(x.x, y.y, z.z):
        if x.x >= y.y and x.x >= z.z:
            q = ti.Vector([1.0 + 2.0 * x.x - trace, y.x + x.y, z.x + x.z, y.z - z.y])
        elif y.y >= z.z:
            q = ti.Vector([y.x + x.y, 1.0 + 2.0 * y.y - trace, z.y + y.z, z.x - x.z])
        else:
            q = ti.Vector([z.x + x.z, z.y + y.z, 1.0 + 2.0 * z.z - trace, x.y - y.x])
    return q / ti.max(q.norm(), 1e-30)


@ti.func
def matrix_of(q):
    """Return the rotation matrix of a quaternion of any length.

    In contrast to `turned`, errors of the length of `q` do not change lengths of vectors.
    """
    s = 2.0 / q.dot(q)
    xx, yy, zz = s * q.x * q.x, s * q.y * q.y, s * q.z * q.z
    xy, yz, xz = s * q.x * q.y, s * q.y * q.z, s * q.x * q.z
    wx, wy, wz = s * q.w * q.x, s * q.w * q.y, s * q.w * q.z
    return ti.Matrix(
        [
            [1.0 - yy - zz, xy - wz, xz + wy],
            [xy + wz, 1.0 - xx - zz, yz - wx],
            [xz - wy, yz + wx, 1.0 - xx - yy],
        ]
    )
