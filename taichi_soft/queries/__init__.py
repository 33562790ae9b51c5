"""Queries on the state of bodies after the last step. Queries do not change the state."""

from taichi_soft.bodies.pose import Pose, best_fitting_pose
from taichi_soft.queries.closest import ClosestPoint, find_closest_point
from taichi_soft.queries.overlaps import Overlap, find_in_box, find_in_sphere
from taichi_soft.queries.rays import RayHit, RayHits, cast_ray, cast_rays

__all__ = [
    "ClosestPoint",
    "Overlap",
    "Pose",
    "RayHit",
    "RayHits",
    "best_fitting_pose",
    "cast_ray",
    "cast_rays",
    "find_closest_point",
    "find_in_box",
    "find_in_sphere",
]
