"""Folders of the demos and the thesis's meshes: inside the package, or next to it in a checkout."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


DEMOS = _folder("demos")
"""Python files that each define a stage."""

ASSETS = _folder("assets")
"""Bodies of the thesis's experiments as .npz; see `assets/README.md` of the sources."""
