"""Fetch three.js (MIT licence), which renders in the browser. Wheels include it; checkouts fetch it.

This module needs only the standard library, because `hatch_build.py` runs it while a wheel is built.
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
"""SHA-512 of the archive, as the registry reports it."""

FOLDER = Path(__file__).parent / "page" / "three"

FILES = (
    "LICENSE",
    "build/three.core.js",
    "build/three.module.js",
    "examples/jsm/controls/OrbitControls.js",
)
"""Files of the archive that the page requests."""


def fetch_three_js(folder: Path = FOLDER) -> None:
    """Fetch the files into a folder, unless they exist.

    Raises: OSError if the registry cannot be reached or sends another archive.
    """
    if all((folder / Path(name).name).is_file() for name in FILES):
        return
    with urllib.request.urlopen(ADDRESS, timeout=60) as answer:
        archive = answer.read()
    found = base64.b64encode(hashlib.sha512(archive).digest()).decode()
    if found != SHA512:
        raise OSError(f"{ADDRESS} has sha512 {found}, expected {SHA512}")
    folder.mkdir(parents=True, exist_ok=True)
    with tarfile.open(fileobj=io.BytesIO(archive)) as packed:
        for name in FILES:
            member = packed.extractfile(f"package/{name}")
            assert member is not None
            part = folder / f"{Path(name).name}.part"
            part.write_bytes(member.read())
            part.replace(folder / Path(name).name)
