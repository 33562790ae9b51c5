"""Check a mesh before it becomes a body, and give advice."""

from taichi_soft.doctor.diagnosis import Grade, diagnose

__all__ = ["Grade", "diagnose"]
