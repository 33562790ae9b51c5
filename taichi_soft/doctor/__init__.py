"""What is right and wrong with a mesh before it becomes a body, in plain words."""

from taichi_soft.doctor.diagnosis import Grade, diagnose

__all__ = ["Grade", "diagnose"]
