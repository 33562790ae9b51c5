"""What results were computed with."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

_PACKAGE = Path(__file__).parents[2]
_ABOVE = {"report", "cli", "demos", "__main__.py"}
"""What lies above the experiments: it shows results, and cannot change them."""


def origin(arch: str) -> dict[str, str]:
    """What tells results apart that may differ: a digest of this package's sources, versions, the device."""
    return {"sources": _digest(), "taichi": version("taichi"), "numpy": version("numpy"), "arch": arch}


def sources() -> list[str]:
    """Files of the package that results depend on, as paths within it."""
    names = [path.relative_to(_PACKAGE) for path in sorted(_PACKAGE.rglob("*.py"))]
    return [name.as_posix() for name in names if _ABOVE.isdisjoint(name.parts[:2])]


@cache
def _digest() -> str:
    found = hashlib.sha256()
    for name in sources():
        found.update(name.encode() + b"\0" + (_PACKAGE / name).read_bytes() + b"\0")
    return found.hexdigest()
