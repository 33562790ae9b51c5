"""Write glTF files according to the specification, with json and struct only."""

import base64
import json
import struct

import numpy as np

COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint16)
"""Triangles of a tetrahedron, facing outwards. The volume is +1/6."""


class GltfWriter:
    """A file that is being written, as `json` and `blob`. The scene shows the nodes that `node` adds."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        self.blob = b""

    def add(self, kind, **entry):
        """Add an entry to the list `kind`, and return its index."""
        self.json.setdefault(kind, []).append(entry)
        return len(self.json[kind]) - 1

    def view(self, content, **entry):
        """Add bytes to the blob, and return the index of their buffer view."""
        self.blob += b"\0" * (-len(self.blob) % 4)
        start = len(self.blob)
        self.blob += content
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(content), **entry)

    def accessor(self, rows, **entry):
        """Store an array (n,) or (n, columns) with its dtype, and return the index of its accessor."""
        rows = np.asarray(rows)
        table = rows.reshape(len(rows), -1)
        return self.add(
            "accessors",
            **{
                "bufferView": self.view(table.tobytes()),
                "componentType": COMPONENTS[rows.dtype.str[1:]],
                "type": TYPES[table.shape[1]],
                "count": len(rows),
                **entry,
            },
        )

    def mesh(self, positions=TETRAHEDRON, triangles=FACES, weights=None, attributes=None, **primitive):
        """Add a mesh with one primitive, and return its index. Attributes are arrays or accessor indices."""
        columns = {"POSITION": positions, **(attributes or {})}
        entry = {
            "attributes": {
                name: rows if isinstance(rows, int) else self.accessor(rows) for name, rows in columns.items()
            },
            **({} if triangles is None else {"indices": self.accessor(np.ravel(triangles))}),
            **primitive,
        }
        return self.add("meshes", primitives=[entry], **({} if weights is None else {"weights": weights}))

    def node(self, shown=True, **entry):
        """Add a node, and return its index. If `shown` is True, the node is a root of the scene."""
        number = self.add("nodes", **entry)
        if shown:
            self.json["scenes"][0]["nodes"].append(number)
        return number

    def write(self, path, uri=None):
        """Write a .glb, or a .gltf whose buffer is at the address `uri`, by default embedded."""
        buffer = {"byteLength": len(self.blob)}
        if path.suffix == ".gltf":
            buffer["uri"] = (
                uri or "data:application/octet-stream;base64," + base64.b64encode(self.blob).decode()
            )
        text = json.dumps({**self.json, "buffers": self.json.get("buffers", [buffer])}).encode()
        path.write_bytes(text if path.suffix == ".gltf" else glb(text, self.blob))
        return path


def glb(text, blob):
    """Return the bytes of a .glb file."""
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    return (
        struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob))
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(blob), b"BIN\0")
        + blob
    )
