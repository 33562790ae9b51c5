"""Looks of bodies (matte, jelly or cloth) and their codes in kernels."""

from __future__ import annotations

from typing import Literal, TypeAlias

from taichi_soft.core.types import Choice


class Look(Choice):
    """How a surface reflects light."""

    MATTE = "matte"  # rubber: diffuse, with a broad faint highlight
    JELLY = "jelly"  # translucent: soft shading, a bright rim, a sharp highlight
    CLOTH = "cloth"  # thin and two-sided: the back is paler, and some light is transmitted


LookName: TypeAlias = Literal["matte", "jelly", "cloth"]

MATTE, JELLY, CLOTH, CLOTH_BACK = range(4)
"""Look codes in kernels. A cloth has one code for each side."""

CODES = {Look.MATTE: MATTE, Look.JELLY: JELLY, Look.CLOTH: CLOTH}
"""Look code of a surface's front, by look."""
