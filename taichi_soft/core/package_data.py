"""Folders of the demos and of the thesis's meshes: inside the package, or next to it in a source checkout."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


DEMOS = _folder("demos")
"""Folder of Python files that each define a stage."""

ASSETS = _folder("assets")
"""Folder with the bodies of the thesis's experiments as .npz, see `assets/README.md` in the source
checkout."""
