"""Packages that a report needs, beyond those of the rest."""

from __future__ import annotations

from taichi_soft.core.required_packages import require_packages

EXTRA = {"jinja2": "jinja2", "matplotlib": "matplotlib", "scipy": "scipy", "skfem": "scikit-fem"}
"""Modules of the extra `report`, and the packages that have them."""


def require_extra() -> None:
    """Raises: OptionError where one is missing."""
    require_packages("a report", "report", EXTRA)
