"""Describe the origin of results: sources, versions and device."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

_ROOT = Path(__file__).parents[2]
_ABOVE = {"report", "cli", "__main__.py"}
"""Layers above the experiments. These layers only show results, so changes to them leave results valid."""


def origin(arch: str) -> dict[str, str]:
    """Return the origin of results: a digest of the sources, versions, and the device."""
    return {"sources": _digest(), "taichi": version("taichi"), "numpy": version("numpy"), "arch": arch}


def sources() -> list[str]:
    """List the files of the library and the lab on which results depend, as paths in the checkout."""
    found = [path for folder in ("lab", "taichi_soft") for path in sorted((_ROOT / folder).rglob("*.py"))]
    names = [path.relative_to(_ROOT) for path in found]
    return [name.as_posix() for name in names if _ABOVE.isdisjoint(name.parts[1:3])]


@cache
def _digest() -> str:
    found = hashlib.sha256()
    for name in sources():
        found.update(name.encode() + b"\0" + (_ROOT / name).read_bytes() + b"\0")
    return found.hexdigest()
