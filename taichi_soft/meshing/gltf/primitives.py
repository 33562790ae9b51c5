"""Primitives of a glTF mesh: vertices, attributes and triangles, with or without Draco compression."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.core.extras import missing_packages
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.gltf.document import (
    COLUMNS,
    Document,
    Entry,
    component_type,
    copy_command,
    decoded,
    read_count,
)
from taichi_soft.meshing.gltf.nodes import extension

DRACO = "KHR_draco_mesh_compression"

TRIANGLES, STRIP, FAN = 4, 5, 6
"""Modes of primitives with separate triangles, a triangle strip or a triangle fan. The other modes are points
and lines."""


class Primitive:
    """One primitive of a mesh.

    Attributes:
        entry: JSON of the primitive.
        name: name for error messages, such as "primitive 0 of mesh 2".
    """

    def __init__(self, document: Document, entry: Entry, name: str) -> None:
        self.document, self.entry, self.name = document, entry, name
        self._attributes: Entry = document.entry("attributes", entry)
        self._faces, self._compressed = self._decompress()

    @property
    def has_triangles(self) -> bool:
        """True if the primitive has triangles and not only points or lines."""
        return "POSITION" in self._attributes and self.entry.get("mode", TRIANGLES) in (TRIANGLES, STRIP, FAN)

    def values(self, attribute: str, *types: str) -> FloatArray | None:
        """Return an attribute as real numbers, (n, columns), or None if it is missing."""
        rows = self.rows(attribute, *types)
        return (
            None
            if rows is None
            else decoded(rows, self.document.named("accessors", self._attributes[attribute]))
        )

    def rows(self, attribute: str, *types: str) -> NDArray[Any] | None:
        """Return an attribute as stored, (n, columns), or None if it is missing.

        Raises: MeshError unless the attribute has one row for each vertex.
        """
        if attribute not in self._attributes:
            return None
        found = self._compressed.get(attribute)
        if found is None:
            found = self.document.rows(self._attributes[attribute], *types)
        if len(found) != self.vertex_count:
            raise MeshError(
                f"cannot be read: {self.name} has {len(found):,} rows of {attribute} for "
                f"{self.vertex_count:,} vertices"
            )
        return found

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        if "POSITION" in self._compressed:
            return len(self._compressed["POSITION"])
        number = self._attributes["POSITION"]
        return read_count(self.document.named("accessors", number), "count", f"accessor {number}")

    def vertices(self, weights: Sequence[float]) -> tuple[FloatArray, FloatArray | None]:
        """Blend the morph targets. Returns: positions (n, 3), and normals (n, 3) or None.

        Args:
            weights: weights of the morph targets. Missing weights are 0.
        """
        positions, normals = self.values("POSITION", "VEC3"), self.values("NORMAL", "VEC3")
        assert positions is not None
        for weight, target in zip(weights, self.entry.get("targets", ()), strict=False):
            for name, rows in (("POSITION", positions), ("NORMAL", normals)):
                if weight == 0.0 or rows is None or name not in target:
                    continue
                moved = self.document.values(target[name], "VEC3")
                if len(moved) != len(rows):
                    raise MeshError(f"cannot be read: a morph target of {self.name} has {len(moved):,} rows")
                rows += weight * moved
        return positions, normals

    def triangles(self, count: int) -> NDArray[np.int64]:
        """Return the vertex indices of the primitive's triangles, (m, 3).

        Args:
            count: number of vertices.
        Raises: MeshError for an index out of range, or corners that do not form complete triangles.
        """
        if self._faces is not None:
            corners = self._faces.astype(np.int64).reshape(-1)
        elif "indices" in self.entry:
            corners = self.document.rows(self.entry["indices"], "SCALAR")[:, 0].astype(np.int64)
        else:
            corners = np.arange(count)
        if len(corners) and not 0 <= corners.min() <= corners.max() < count:
            raise MeshError(f"cannot be read: {self.name} refers to vertex {corners.max():,} of {count:,}")
        mode = TRIANGLES if self._faces is not None else self.entry.get("mode", TRIANGLES)
        if mode == TRIANGLES:
            if len(corners) % 3:
                raise MeshError(
                    f"cannot be read: {self.name} has {len(corners):,} triangle corners, not a multiple of 3"
                )
            return corners.reshape(-1, 3)
        return _strip(corners) if mode == STRIP else _fan(corners)

    def _decompress(self) -> tuple[NDArray[Any] | None, dict[str, NDArray[Any]]]:
        """Decompress triangles and attributes with Draco.

        Returns: triangles (m, 3), and attributes by name; None and {} if they are not compressed.
        Raises: MeshError for damaged data, or if DracoPy is missing and the file has no uncompressed copy.
        """
        compression = extension(self.entry, DRACO)
        if not compression:
            return None, {}
        if missing_packages("io", "DracoPy"):
            if all(
                "bufferView" in self.document.named("accessors", each) for each in self._attributes.values()
            ):
                return None, {}
            raise MeshError(
                f"is compressed with {DRACO}, which DracoPy decodes: run pip install 'taichi-soft[io]'. "
                f"Or {copy_command(self.document.path)}"
            )
        import DracoPy

        data, _ = self.document.view(compression.get("bufferView"))
        try:
            mesh = DracoPy.decode(bytes(data))
        except Exception as error:  # DracoPy raises exceptions of many kinds on damaged data
            reason = " ".join(str(error).split())[:100]
            raise MeshError(
                f"cannot be read: the {DRACO} data of {self.name} is damaged ({reason})"
            ) from None
        found = {each["unique_id"]: each["data"] for each in mesh.attributes}
        numbers = self.document.entry("attributes", compression)
        missing = [name for name, number in numbers.items() if number not in found]
        if missing:
            raise MeshError(f"cannot be read: the {DRACO} data of {self.name} lacks {', '.join(missing)}")
        rows = {}
        for name, number in numbers.items():  # DracoPy returns integers as reals: restore the accessor's type
            accessor = self.document.named("accessors", self._attributes.get(name))
            rows[name] = found[number].reshape(len(found[number]), -1).astype(component_type(accessor, name))
            if rows[name].shape[1] != COLUMNS.get(accessor.get("type", "")):
                raise MeshError(f"cannot be read: the {DRACO} data of {self.name} does not fit {name}")
        return getattr(mesh, "faces", np.zeros((0, 3), np.int64)), rows


def _strip(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles of a strip, (m, 3). Triangles that repeat a corner are dropped."""
    found = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    found[1::2] = found[1::2, [1, 0, 2]]
    a, b, c = found.T
    return np.asarray(found[(a != b) & (b != c) & (c != a)])


def _fan(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles of a fan, (m, 3). All triangles share the first corner."""
    rim = corners[1:]
    return np.stack([np.broadcast_to(corners[:1], max(len(rim) - 1, 0)), rim[:-1], rim[1:]], axis=1)
