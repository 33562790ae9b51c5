"""three.js, which draws in the browser (MIT licence): a wheel brings it, a checkout fetches it.

Needs nothing but Python: `hatch_build.py` runs it while a wheel is built.
"""

from __future__ import annotations

import base64
import hashlib
import io
import tarfile
import urllib.request
from pathlib import Path

VERSION = "0.187.0"
ADDRESS = f"https://registry.npmjs.org/three/-/three-{VERSION}.tgz"
SHA512 = "Qiu7R+Cmh8CstZsY1uJOSWnVlfo7ZtNLV7mF8Jltk3LB3AtDu9cRZlcnRKkAk8Y4z6KKw35z7Y7Urd7jWY8etA=="
"""Of the archive, as the registry tells it."""

FOLDER = Path(__file__).parent / "page" / "three"

FILES = (
    "LICENSE",
    "build/three.core.js",
    "build/three.module.js",
    "examples/jsm/controls/OrbitControls.js",
)
"""Of the archive, what a page asks for."""


def fetch_three_js(folder: Path = FOLDER) -> None:
    """Have its files in a folder; nothing happens where they are.

    Raises: OSError where the registry cannot be reached, or sends something else.
    """
    if all((folder / Path(name).name).is_file() for name in FILES):
        return
    with urllib.request.urlopen(ADDRESS, timeout=60) as answer:
        archive = answer.read()
    found = base64.b64encode(hashlib.sha512(archive).digest()).decode()
    if found != SHA512:
        raise OSError(f"{ADDRESS} has sha512 {found}, and not {SHA512}")
    folder.mkdir(parents=True, exist_ok=True)
    with tarfile.open(fileobj=io.BytesIO(archive)) as packed:
        for name in FILES:
            member = packed.extractfile(f"package/{name}")
            assert member is not None
            part = folder / f"{Path(name).name}.part"
            part.write_bytes(member.read())
            part.replace(folder / Path(name).name)
