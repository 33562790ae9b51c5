"""From how a body is to behave back to what it is made of."""

from taichi_soft.feel.feel import Behaviour, Feel, material_from_feel

__all__ = ["Behaviour", "Feel", "material_from_feel"]
