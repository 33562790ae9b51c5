"""Constants of the springs between particles (thesis section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.errors import MaterialError
from taichi_soft.core.serialisation import serialised
from taichi_soft.elements.materials.element_values import (
    LARGEST,
    POSITIVE,
    Array,
    as_constant,
    described,
    is_damping,
    is_positive,
    require_one_length,
    spread,
)


def _is_stiffness(x: Array) -> NDArray[np.bool_]:
    """True for 0, and for positive values in the range of valid constants."""
    return np.asarray((x == 0) | is_positive(x))


@serialised("stiffness", "damping", "rest_length")
@dataclass(frozen=True, eq=False)
class SpringMaterial:
    """Springs of a `ParticleMesh`. Each constant is a number, or an array with one number per edge.

    Args:
        stiffness: stiffness k, thesis eq. 3.8 [N/m], 0 or more, and above 0 for at least one edge. An edge
            with stiffness 0 has only damping.
        damping: damping constant b, eq. 3.9 [N s/m], 0 or more.
        rest_length: length at rest l, eq. 3.8 [m], above 0; None for the lengths in the mesh.
    Raises: MaterialError with the first value out of range, or if no edge has any stiffness.
    """

    stiffness: float | Array
    damping: float | Array = 0.0
    rest_length: float | Array | None = None

    def __repr__(self) -> str:
        return described(self)

    def __post_init__(self) -> None:
        self._check("stiffness", _is_stiffness, f"0 N/m, or {POSITIVE}")
        if not np.any(self.stiffness):
            raise MaterialError("stiffness is 0 N/m for every edge: make at least one edge stiffer")
        self._check("damping", is_damping, f"0 N s/m or more and below {LARGEST:g}")
        if self.rest_length is not None:
            self._check("rest_length", is_positive, f"above 0 m, {POSITIVE}")
        given = {"stiffness": self.stiffness, "damping": self.damping, "rest_length": self.rest_length}
        require_one_length(given, "edge")

    def _check(self, name: str, is_valid: Any, range_text: str) -> None:
        object.__setattr__(self, name, as_constant(getattr(self, name), name, "edge", is_valid, range_text))

    @classmethod
    def from_young(
        cls, young: float, area: ArrayLike, lengths: ArrayLike, damping: float | Array = 0.0
    ) -> SpringMaterial:
        """Return springs with the stiffness of bars: k = E a / l (eq. 5.1).

        Args:
            young: Young's modulus E [Pa].
            area: cross-section a [m^2]: one number for all bars, or one number per bar.
            lengths: lengths l of the bars at rest [m], such as `mesh.edge_lengths`.
            damping: b [N s/m].
        Raises: MaterialError for a number that is not positive or for arrays of different lengths.
        """
        E, a, l = (  # noqa: E741
            np.asarray(as_constant(value, name, "edge", is_positive, f"above 0 {unit}, {POSITIVE}"))
            for value, name, unit in (
                (young, "young", "Pa"),
                (area, "area", "m^2"),
                (lengths, "lengths", "m"),
            )
        )
        if a.ndim and l.ndim and len(a) != len(l):
            raise MaterialError(
                f"area has {len(a)} values and lengths has {len(l)}: pass one per edge in each"
            )
        stiffness = E * a / l
        return cls(stiffness if stiffness.ndim else float(stiffness), damping, l if l.ndim else float(l))

    def per_edge(self, name: str, edge_count: int, default: Array | None = None) -> Array:
        """Return one value of a constant for each of `edge_count` edges; `default` if the constant is None.

        Args:
            name: "stiffness", "damping" or "rest_length".
            edge_count: number of edges.
            default: value of each edge, (edge_count,), for a constant that is None.
        Raises: MaterialError if the constant is an array of another length.
        """
        given = getattr(self, name)
        return spread(default if given is None else given, name, "edges", edge_count)  # type: ignore[arg-type]
