"""Where the demos and the thesis's meshes lie: inside the package, or beside it in a checkout."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def _folder(name: str) -> Path:
    installed = _PACKAGE / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


DEMOS = _folder("demos")
"""Python files, each of which sets a stage."""

ASSETS = _folder("assets")
"""The bodies of the thesis's experiments as .npz; `assets/README.md` of the sources tells of them."""
