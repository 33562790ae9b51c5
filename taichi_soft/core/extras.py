"""Extras: optional packages, and advice how to install missing ones."""

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
"""Modules of each extra and the packages that provide them, as in pyproject.toml."""


def missing_packages(extra: str, *modules: str) -> list[str]:
    """Return the missing packages of an extra; if `modules` are given, only of these."""
    return missing_among(EXTRAS[extra], *modules)


def missing_among(packages: Mapping[str, str], *modules: str) -> list[str]:
    """Return the missing packages of a table by module; if `modules` are given, only of these."""
    return [packages[module] for module in modules or packages if not _is_there(module)]


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ImportError:
        return False


def require_extra(extra: str, what: str, *modules: str) -> None:
    """Raise a MissingExtraError if a package of the extra is missing.

    Args:
        what: feature that needs the extra, with a verb: "a film needs".
        modules: required modules of the extra; all by default.
    """
    missing = missing_packages(extra, *modules)
    if missing:
        names = ", ".join(missing)
        raise MissingExtraError(f"{what} {names}, not installed here: run pip install 'taichi-soft[{extra}]'")
