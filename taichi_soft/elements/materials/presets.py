"""Named materials with rounded textbook values, as a starting point.

Moduli and densities are from M. F. Ashby, Materials Selection in Mechanical Design (property tables). The
modulus of gelatine is at the stiff end of the usual range of 1 to 100 kPa. With the thesis's law and tolerant
flips, a fall from several metres still dents gelatine permanently. Damping ratios are half the usual loss
factors at a few hertz, rounded. `thesis_sphere` is from thesis section 6.6 and has only damping along edges.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from taichi_soft.core.checks import choose_one_of
from taichi_soft.core.errors import OptionError
from taichi_soft.elements.materials.material import Material

PresetName: TypeAlias = Literal["thesis_sphere", "gelatine", "soft_rubber", "foam", "cork", "auxetic_foam"]

PRESETS: dict[PresetName, Material] = {
    "thesis_sphere": Material(young=1.0e6, poisson=0.1, density=1000.0, damping=100.0, damping_ratio=0.0),
    "gelatine": Material(young=1.0e5, poisson=0.45, density=1050.0, damping_ratio=0.08),
    "soft_rubber": Material(young=2.0e6, poisson=0.47, density=1100.0, damping_ratio=0.05),
    "foam": Material(young=1.0e6, poisson=0.3, density=60.0, damping_ratio=0.1),
    "cork": Material(young=2.0e7, poisson=0.0, density=180.0, damping_ratio=0.05),
    "auxetic_foam": Material(young=5.0e5, poisson=-0.5, density=80.0, damping_ratio=0.1),
}


def preset(name: PresetName) -> Material:
    """Return the material with a name.

    Args:
        name: a key of `PRESETS`, such as "gelatine".
    Raises: OptionError, with the available names, for an unknown name.
    """
    if not isinstance(name, str) or name not in PRESETS:
        raise OptionError(f"unknown material {name!r}: {choose_one_of(PRESETS, name)}")
    return PRESETS[name]
