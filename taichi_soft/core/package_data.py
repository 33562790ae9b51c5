"""Folders with the demos and with the meshes of the thesis.

The folders are inside the package or, in a source checkout, next to it.
"""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


DEMOS = _folder("demos")
"""Folder of Python files that each define a stage."""

ASSETS = _folder("assets")
"""Folder with the bodies of the thesis's experiments as .npz files. `assets/README.md` in the source checkout
describes the files."""
