"""What is right and wrong with a mesh before it becomes a body, in plain words."""

from taichi_soft.lab.doctor.diagnosis import Diagnosis, Finding, Grade, diagnose

__all__ = ["Diagnosis", "Finding", "Grade", "diagnose"]
