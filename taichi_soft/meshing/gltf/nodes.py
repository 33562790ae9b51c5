"""Nodes of a glTF file: their matrices, and which nodes the default scene shows."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.gltf.document import Document, Entry

INSTANCING = "EXT_mesh_gpu_instancing"
VISIBILITY = "KHR_node_visibility"


def world_matrices(document: Document) -> FloatArray:
    """Return the matrix from each node's axes to the file's axes, (n, 4, 4).

    Raises: MeshError for a node that has two parents or is its own descendant.
    """
    nodes = document.entries("nodes")
    parents = np.full(len(nodes), -1)
    for number in range(len(nodes)):
        for child in document.named("nodes", number).get("children", ()):
            document.named("nodes", child)
            if parents[child] >= 0:
                raise MeshError(
                    f"cannot be read: node {child} has two parents, {parents[child]} and {number}"
                )
            parents[child] = number
    order = [int(root) for root in np.flatnonzero(parents < 0)]
    for number in order:  # the list grows during the loop: children follow their parents
        order.extend(nodes[number].get("children", ()))
    if len(order) < len(nodes):
        number = min(set(range(len(nodes))) - set(order))
        raise MeshError(f"cannot be read: its nodes form a cycle: node {number} is its own descendant")
    matrices = np.empty((len(nodes), 4, 4))
    for number in order:
        local = _local_matrix(nodes[number], number)
        matrices[number] = matrices[parents[number]] @ local if parents[number] >= 0 else local
    return matrices


def shown_nodes(document: Document) -> list[int]:
    """Return the numbers of the visible nodes of the default scene, parents before their children.

    If the file has no default scene, the first scene is used. If the file has no scene, all nodes are used.
    """
    nodes = document.entries("nodes")
    if document.entries("scenes"):
        roots = document.named("scenes", document.json.get("scene", 0)).get("nodes", [])
    else:
        children = {child for node in nodes for child in node.get("children", ())}
        roots = [number for number in range(len(nodes)) if number not in children]
    found: dict[int, None] = {}
    stack = list(reversed(roots))
    while stack:
        number = stack.pop()
        node = document.named("nodes", number)
        if number in found or extension(node, VISIBILITY).get("visible") is False:
            continue
        found[number] = None
        stack.extend(reversed(node.get("children", ())))
    return list(found)


def instance_matrices(document: Document, node: Entry) -> FloatArray | None:
    """Return the matrices from mesh instances to the node's axes, (k, 4, 4), or None without instances."""
    attributes = extension(node, INSTANCING).get("attributes")
    if not attributes:
        return None
    types = {"TRANSLATION": ("VEC3", 3), "ROTATION": ("VEC4", 4), "SCALE": ("VEC3", 3)}
    rows = {
        name: document.values(attributes[name], kind)
        for name, (kind, _) in types.items()
        if name in attributes
    }
    counts = {len(each) for each in rows.values()}
    if len(counts) != 1:
        raise MeshError(f"cannot be read: {INSTANCING} has attributes for {sorted(counts)} instances")
    count = counts.pop()
    rotations = rows.get("ROTATION", np.broadcast_to([0.0, 0.0, 0.0, 1.0], (count, 4)))
    return composed(
        rows.get("TRANSLATION", np.zeros((count, 3))), rotations, rows.get("SCALE", np.ones((count, 3)))
    )


def extension(entry: Entry, name: str) -> Entry:
    """Return the extension `name` of an entry, or an empty object."""
    found = (entry.get("extensions") or {}).get(name, {})
    return found if isinstance(found, dict) else {}


def composed(translations: FloatArray, rotations: FloatArray, scales: FloatArray) -> FloatArray:
    """Return matrices that scale, then rotate, then translate, (k, 4, 4).

    Args:
        translations: (k, 3) [m].
        rotations: quaternions (x, y, z, w), (k, 4), of any length. A quaternion of length 0 does not rotate.
        scales: factors along x, y and z, (k, 3).
    """
    lengths = np.linalg.norm(rotations, axis=1, keepdims=True)
    unit = np.where(lengths > 0.0, rotations / np.where(lengths > 0.0, lengths, 1.0), [0.0, 0.0, 0.0, 1.0])
    x, y, z, w = unit.T
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrices = np.tile(np.eye(4), (len(unit), 1, 1))
    matrices[:, :3, :3] = np.moveaxis(rotation, 2, 0) * scales[:, None, :]
    matrices[:, :3, 3] = translations
    return matrices


def _local_matrix(node: Entry, number: int) -> FloatArray:
    if "matrix" in node:
        columns = _numbers(node["matrix"], 16, f"matrix of node {number}").reshape(4, 4)
        return np.asarray(columns.T)
    parts = [
        _numbers(node.get(key, default), len(default), f"{key} of node {number}")[None]
        for key, default in (
            ("translation", (0.0, 0.0, 0.0)),
            ("rotation", (0.0, 0.0, 0.0, 1.0)),
            ("scale", (1.0, 1.0, 1.0)),
        )
    ]
    return np.asarray(composed(*parts)[0])


def _numbers(values: Any, count: int, name: str) -> FloatArray:
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise MeshError(f"cannot be read: {name} is {str(values)[:60]}, not {count} finite numbers")
    return found
