"""Extras: groups of optional packages, and advice on how to install a missing package."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec

from taichi_soft.core.errors import MissingExtraError

EXTRAS = {
    "cli": {"typer": "typer", "rich": "rich"},
    "film": {"cv2": "opencv-python-headless", "imageio_ffmpeg": "imageio-ffmpeg", "PIL": "pillow"},
    "bake": {"PIL": "pillow", "pygltflib": "pygltflib"},
    "usd": {"pxr": "usd-core"},
    "export": {"llvmlite": "llvmlite", "ziglang": "ziglang"},
    "io": {"meshio": "meshio", "DracoPy": "dracopy"},
    "voronoi": {"scipy": "scipy"},
    "panda3d": {"panda3d": "panda3d"},
    "live": {
        "websockets": "websockets",
        "cv2": "opencv-python-headless",
        "imageio_ffmpeg": "imageio-ffmpeg",
        "PIL": "pillow",
    },
    "tetgen": {"tetgen": "tetgen"},
    "ftetwild": {"pytetwild": "pytetwild"},
}
"""For each extra in pyproject.toml, the modules that it needs and the package that provides each module."""


def missing_packages(extra: str, *modules: str) -> list[str]:
    """Return the packages of an extra that are not installed.

    Args:
        extra: key of `EXTRAS`.
        modules: modules to check; by default all modules of the extra.
    """
    return missing_among(EXTRAS[extra], *modules)


def missing_among(packages: Mapping[str, str], *modules: str) -> list[str]:
    """Return the packages of a table that are not installed.

    Args:
        packages: name of the package that provides each module.
        modules: modules to check; by default all modules of the table.
    """
    return [packages[module] for module in modules or packages if not _is_there(module)]


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ImportError:
        return False


def require_extra(extra: str, what: str, *modules: str) -> None:
    """Raise a MissingExtraError if a package of the extra is missing.

    Args:
        what: start of the error message, such as "a film needs": the feature that needs the extra, and a
            verb.
        modules: required modules; by default all modules of the extra.
    """
    missing = missing_packages(extra, *modules)
    if missing:
        names = ", ".join(missing)
        raise MissingExtraError(f"{what} {names}, not installed here: run pip install 'taichi-soft[{extra}]'")
