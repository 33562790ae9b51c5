"""Packages that a report needs, beyond those of the rest."""

from __future__ import annotations

from importlib.util import find_spec

from taichi_soft.core.errors import OptionError

EXTRA = {"jinja2": "jinja2", "matplotlib": "matplotlib", "scipy": "scipy", "skfem": "scikit-fem"}
"""Modules of the extra `report`, and the packages that have them."""


def require_extra() -> None:
    """Raises: OptionError where one is missing."""
    missing = [package for module, package in EXTRA.items() if find_spec(module) is None]
    if missing:
        raise OptionError(
            f"a report needs {', '.join(missing)}, not installed here: run pip install 'taichi-soft[report]'"
        )
