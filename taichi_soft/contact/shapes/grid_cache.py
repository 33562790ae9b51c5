"""A cache of distance grids on disk, so that a game computes each grid only once."""

from __future__ import annotations

import contextlib
import hashlib
import os
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.shapes.closed_mesh import ClosedMesh
from taichi_soft.contact.shapes.distance_grid import Grid

VERSION = b"taichi-soft distance grid 1"
"""Format version. Change it if the format of the file or the meaning of its numbers changes."""

DIGEST = hashlib.sha256().digest_size


def cache_folder() -> Path:
    """Return $TAICHI_SOFT_CACHE, or the folder `taichi-soft` in the user's cache folder."""
    chosen = os.environ.get("TAICHI_SOFT_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or "~/AppData/Local"
    elif sys.platform == "darwin":
        base = "~/Library/Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(os.path.expanduser(base)) / "taichi-soft"


def grid_key(mesh: ClosedMesh, grid: Grid) -> str:
    """Return a hash of the mesh and the spacing, which determine all distances."""
    digest = hashlib.sha256(VERSION)
    for array in (mesh.vertices.astype("<f8"), mesh.triangles.astype("<i4"), np.array([grid.cell], "<f8")):
        digest.update(len(array).to_bytes(8, "little") + array.tobytes())
    return digest.hexdigest()


def read_grid(key: str, grid: Grid) -> NDArray[np.float32] | None:
    """Return the stored distances, (nx, ny, nz) [m], or None if the file is missing or damaged."""
    try:
        content = _path(key).read_bytes()
    except OSError:
        return None
    digest, payload = content[:DIGEST], content[DIGEST:]
    if digest != _checksum(key, payload) or len(payload) != 4 * np.prod(grid.resolution):
        return None
    return np.frombuffer(payload, "<f4").astype(np.float32).reshape(grid.resolution)


def write_grid(key: str, distances: NDArray[np.float32]) -> None:
    """Store distances on disk. A failure is ignored: the next start computes the distances again."""
    payload = distances.astype("<f4").tobytes()
    path = _path(key)
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        # Replace the file in one operation, so that no other process reads an incomplete file.
        handle, name = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_checksum(key, payload) + payload)
            os.replace(name, path)
        except OSError:
            os.unlink(name)


def _path(key: str) -> Path:
    return cache_folder() / f"{key}.grid"


def _checksum(key: str, payload: bytes) -> bytes:
    return hashlib.sha256(key.encode() + payload).digest()
