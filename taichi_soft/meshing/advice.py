"""Suggested fixes that several error messages share."""

from __future__ import annotations

import importlib.util
from typing import Any


def with_install_hint(call: str, *packages: str) -> str:
    """Return `call`. If some of `packages` are missing, append the command that installs them."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if not missing:
        return call
    return (
        f"{call} (which needs {' and '.join(missing)}, not installed here: pip install {' '.join(missing)})"
    )


def scene_hint(source: Any) -> str:
    """Return a hint on how to join a trimesh.Scene into one mesh; an empty string for any other source."""
    if not (hasattr(source, "geometry") and hasattr(source, "graph")):
        return ""
    method = "to_geometry()" if hasattr(source, "to_geometry") else "dump(concatenate=True)"
    return f': read the file by trimesh.load(path, force="mesh"), or join the scene by scene.{method}'


def fill_hint(surface: str) -> str:
    """Return a hint on how to make a body from a surface.

    Args: surface: Python expression for the surface.
    """
    return f"SoftBodyAsset.from_surface({surface}, material) makes a body from it"
