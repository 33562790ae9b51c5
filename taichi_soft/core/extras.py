"""Extras: packages that a game need not install, and how to get them where one is missing."""

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
"""By extra: its modules, and the packages that have them, as in pyproject.toml."""


def missing_packages(extra: str, *modules: str) -> list[str]:
    """Packages of the extra, or those of these modules, that are not installed."""
    return missing_among(EXTRAS[extra], *modules)


def missing_among(packages: Mapping[str, str], *modules: str) -> list[str]:
    """Packages that are not installed, of those by module, or of those of these modules."""
    return [packages[module] for module in modules or packages if not _is_there(module)]


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ImportError:
        return False


def require_extra(extra: str, what: str, *modules: str) -> None:
    """Raises: MissingExtraError in one line where a package of the extra is missing.

    Args:
        what: what needs it, and a verb: "a film needs".
        modules: of the extra, where it needs these only.
    """
    missing = missing_packages(extra, *modules)
    if missing:
        names = ", ".join(missing)
        raise MissingExtraError(f"{what} {names}, not installed here: run pip install 'taichi-soft[{extra}]'")
