"""Material constants from the requested behaviour of a body."""

from taichi_soft.feel.feel import Behaviour, Feel, material_from_feel

__all__ = ["Behaviour", "Feel", "material_from_feel"]
