"""Suggested fixes that several error messages share."""

from __future__ import annotations

import importlib.util
from typing import Any


def with_install_hint(call: str, *packages: str) -> str:
    """Append to `call` how to install those of its packages that are missing."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if not missing:
        return call
    return (
        f"{call} (which needs {' and '.join(missing)}, not installed here: pip install {' '.join(missing)})"
    )


def scene_hint(source: Any) -> str:
    """Suggest how to make one mesh of a trimesh.Scene; empty for any other source."""
    if not (hasattr(source, "geometry") and hasattr(source, "graph")):
        return ""
    method = "to_geometry()" if hasattr(source, "to_geometry") else "dump(concatenate=True)"
    return f': read the file by trimesh.load(path, force="mesh"), or join the scene by scene.{method}'


def fill_hint(surface: str) -> str:
    """Suggest how to make a body from the surface that the expression `surface` returns."""
    return f"SoftBodyAsset.from_surface({surface}, material) makes a body from it"
