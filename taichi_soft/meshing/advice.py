"""Suggested fixes that several error messages share."""

from __future__ import annotations

import importlib.util
from typing import Any


def with_install_hint(call: str, *packages: str) -> str:
    """Return `call`, followed by how to install those of `packages` that are missing."""
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
    """Return a hint on how to make a body from a surface; `surface` is the code that evaluates to it."""
    return f"SoftBodyAsset.from_surface({surface}, material) makes a body from it"
