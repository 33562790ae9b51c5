"""Read glTF according to its specification, with json and NumPy only."""

import json
import struct

import numpy as np

TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """A .glb file: its JSON data in `json`, and the arrays of its accessors."""

    def __init__(self, path):
        data = path.read_bytes()
        magic, version, length = struct.unpack("<4sII", data[:12])
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack("<I4s", data[12:20])
        assert kind == b"JSON"
        self.json = json.loads(data[20 : 20 + size])
        rest = data[20 + size :]
        size, kind = struct.unpack("<I4s", rest[:8])
        assert (kind, size) == (b"BIN\0", len(rest) - 8)
        self.blob = rest[8:]

    def array(self, number):
        """Return the array of an accessor, (count, columns)."""
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        assert "byteStride" not in view
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        count = accessor["count"] * COLUMNS[accessor["type"]]
        flat = np.frombuffer(self.blob, TYPES[accessor["componentType"]], count, start)
        return flat.reshape(accessor["count"], -1)

    def node(self, name):
        """Return the index of the node with this name."""
        return [node["name"] for node in self.json["nodes"]].index(name)

    def primitive(self, name):
        """Return the primitive of a node's mesh."""
        (primitive,) = self.json["meshes"][self.json["nodes"][self.node(name)]["mesh"]]["primitives"]
        return primitive

    def channel(self, name, path):
        """Return times (k,), values (k, columns) and interpolation of a node's animation, or None."""
        (animation,) = self.json.get("animations", [{"channels": []}])
        for channel in animation["channels"]:
            if channel["target"] == {"node": self.node(name), "path": path}:
                sampler = animation["samplers"][channel["sampler"]]
                times = self.array(sampler["input"])[:, 0]
                values = self.array(sampler["output"]).reshape(len(times), -1)
                return times, values, sampler["interpolation"]
        return None

    def shape(self, name, time, what="POSITION"):
        """Return positions or normals of a node's mesh at a time, y up: base + sum of weights * targets."""
        primitive = self.primitive(name)
        rows = self.array(primitive["attributes"][what]).astype(np.float64)
        channel = self.channel(name, "weights")
        if channel is None:
            return rows
        times, weights, interpolation = channel
        if interpolation == "STEP":
            at = weights[max(np.searchsorted(times, time, side="right") - 1, 0)]
        else:
            at = [np.interp(time, times, column) for column in weights.T]
        for weight, target in zip(at, primitive["targets"], strict=True):
            rows = rows + weight * self.array(target[what])
        return rows


def z_up(rows):
    """Convert vectors from glTF's axes (y up) to a world's axes (z up)."""
    return np.stack([rows[:, 0], -rows[:, 2], rows[:, 1]], axis=1)
