"""Queries on the state of bodies after the last step. Queries do not change the state."""

from taichi_soft.bodies.pose import Pose, best_fitting_pose
from taichi_soft.queries.closest import ClosestPoint, find_closest_point
from taichi_soft.queries.overlaps import Overlap, find_in_box, find_in_sphere
from taichi_soft.queries.query import ChosenColliders, Targets, targets_of
from taichi_soft.queries.rays import RayHit, RayHits, cast_ray, cast_rays
from taichi_soft.queries.shape_casts import ShapeHit, cast_shape

__all__ = [
    "ChosenColliders",
    "ClosestPoint",
    "Overlap",
    "Pose",
    "RayHit",
    "RayHits",
    "ShapeHit",
    "Targets",
    "best_fitting_pose",
    "cast_ray",
    "cast_rays",
    "cast_shape",
    "find_closest_point",
    "find_in_box",
    "find_in_sphere",
    "targets_of",
]
