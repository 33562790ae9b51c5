"""Ways out that several refusals name."""

from __future__ import annotations

import importlib.util
from typing import Any


def needing(call: str, *packages: str) -> str:
    """`call`, and how to get those of the packages it needs that are not installed."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if not missing:
        return call
    return (
        f"{call} (which needs {' and '.join(missing)}, not installed here: pip install {' '.join(missing)})"
    )


def joining(source: Any) -> str:
    """How to get one mesh where a trimesh.Scene was given, and nothing to say of anything else."""
    if not (hasattr(source, "geometry") and hasattr(source, "graph")):
        return ""
    method = "to_geometry()" if hasattr(source, "to_geometry") else "dump(concatenate=True)"
    return f': read the file by trimesh.load(path, force="mesh"), or join the scene by scene.{method}'


def filling(surface: str) -> str:
    """How to get a body from a surface that the expression `surface` gives."""
    return f"SoftBodyAsset.from_surface({surface}, material) makes a body of it"
