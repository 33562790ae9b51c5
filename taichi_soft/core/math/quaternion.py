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
