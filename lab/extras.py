"""Extras of a checkout: packages that only the lab needs, and how to install them."""

from __future__ import annotations

from taichi_soft.core.errors import MissingExtraError
from taichi_soft.core.extras import missing_among

EXTRAS = {
    "lab": {
        "cv2": "opencv-python-headless",
        "jinja2": "jinja2",
        "matplotlib": "matplotlib",
        "rich": "rich",
        "scipy": "scipy",
        "skfem": "scikit-fem",
    },
    "peers": {"mujoco": "mujoco", "newton": "newton", "pybullet": "pybullet"},
}
"""For each extra in pyproject.toml, the names of its modules and of the packages that contain them."""


def missing_packages(extra: str, *modules: str) -> list[str]:
    """List the packages of an extra that are not installed. `modules` restricts the list to these modules."""
    return missing_among(EXTRAS[extra], *modules)


def how_to_install(extra: str) -> str:
    """Return the command that installs an extra in this checkout."""
    return f"pip install -e '.[{extra}]'"


def require_report() -> None:
    """Raise a MissingExtraError if a package that a report needs is missing."""
    missing = missing_packages("lab")
    if missing:
        names = ", ".join(missing)
        raise MissingExtraError(f"a report needs {names}, not installed here: run {how_to_install('lab')}")
