"""What results were computed with."""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

_PACKAGE = Path(__file__).parents[2]
_ABOVE = {"report", "cli.py", "__main__.py"}
"""What lies above the experiments: it shows results, and cannot change them."""


def origin(arch: str) -> dict[str, str]:
    """What tells results apart that may differ: a digest of this package's sources, versions, the device."""
    return {"sources": _digest(), "taichi": version("taichi"), "numpy": version("numpy"), "arch": arch}


@cache
def _digest() -> str:
    found = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        name = path.relative_to(_PACKAGE)
        if _ABOVE.isdisjoint(name.parts[:2]):
            found.update(name.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()
