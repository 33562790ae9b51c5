"""The Taichi fields of joints: which particles are held where in another body, row by row."""

from typing import Any

from taichi_soft.core.runtime import holds_fields, ti

MOST_JOINTS, JOINT_ROWS = 64, 2048
"""Joints of one world at a time, and particles that all of them hold together."""

ENDS = 5
"""Particles that a row names: the one that is held, and four of the other body that hold it. Their positions
times their weights, 1 and four that add up to -1, add up to the gap between the particle and its place."""


@holds_fields
class JointFields:
    """Joints, and the rows that they are made of, packed to the front in the order of joining.

    End k of row r is at r ENDS + k.
    """

    def __init__(self, particles: int) -> None:
        """Allocate; contents are zero."""
        self.bodies = ti.Vector.field(2, ti.i32, MOST_JOINTS)  # numbers plus 1, 0 where there is no joint
        self.rows = ti.Vector.field(2, ti.i32, MOST_JOINTS)  # range
        self.draw_speed = ti.field(ti.f32, MOST_JOINTS)  # [m/s] at which a gap closes, at most
        self.impulse = ti.Vector.field(3, ti.f32, MOST_JOINTS)  # on the first body in the last step [N s]
        self.particle = ti.field(ti.i32, JOINT_ROWS * ENDS)
        self.weight = ti.field(ti.f32, JOINT_ROWS * ENDS)
        self.share = ti.field(ti.f32, JOINT_ROWS * ENDS)  # of an impulse, in the last substep
        self.row_impulse = ti.Vector.field(3, ti.f32, JOINT_ROWS)  # on the first end, in the last substep
        self.approach = ti.Vector.field(3, ti.f32, JOINT_ROWS)  # at which the gap is to change [m/s]
        self.is_held = ti.field(ti.i32, particles)  # 1 where it is the first end of a row

    def carried(self) -> list[list[Any]]:
        """What the next step depends on: of each joint, of each row in use, of each of its ends."""
        return [
            [self.bodies, self.rows, self.draw_speed, self.impulse],
            [self.row_impulse],
            [self.particle, self.weight, self.share],
        ]
