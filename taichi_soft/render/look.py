"""What bodies are made of, to the eye."""

from __future__ import annotations

from typing import Literal, TypeAlias

from taichi_soft.core.types import Choice


class Look(Choice):
    """How a surface throws light back."""

    MATTE = "matte"  # rubber: dull, with a broad faint shine
    JELLY = "jelly"  # light goes in and comes out beside: soft shades, a bright rim, a sharp shine
    CLOTH = "cloth"  # thin, seen from both sides: the back is paler, and some light comes through


LookName: TypeAlias = Literal["matte", "jelly", "cloth"]

MATTE, JELLY, CLOTH, CLOTH_BACK = range(4)
"""How kernels call the looks of triangles; a cloth has two sides."""

CODES = {Look.MATTE: MATTE, Look.JELLY: JELLY, Look.CLOTH: CLOTH}
"""Of the front of a surface."""
