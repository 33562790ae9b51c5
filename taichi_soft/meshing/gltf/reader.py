"""Surfaces of .glb and .gltf files, in the rest pose of their nodes, skins and morph targets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.gltf import looks, nodes
from taichi_soft.meshing.gltf.document import MESHOPT, Document, Entry, copy_command
from taichi_soft.meshing.gltf.looks import Looks
from taichi_soft.meshing.gltf.nodes import INSTANCING, VISIBILITY
from taichi_soft.meshing.gltf.primitives import DRACO, Primitive
from taichi_soft.meshing.surface import Surface, surface_of

READ = (DRACO, "KHR_mesh_quantization", INSTANCING, VISIBILITY, *looks.READ)
"""Supported extensions."""

SHAPELESS = (
    "KHR_technique",
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_animation_",
)
"""Prefixes of extensions that do not change shapes. Files that require these extensions are read."""

MAX_ROWS = 10_000_000
"""Largest total number of vertices and triangles in a scene. Even a small file can exceed this number, if
many nodes show the same mesh."""


@dataclass(frozen=True, eq=False)
class _Part:
    """All instances of one primitive in the scene, in the file's axes."""

    name: str
    vertices: FloatArray  # (n, 3) [m]
    triangles: NDArray[np.int64]  # (m, 3)
    normals: FloatArray | None  # (n, 3), of any length; None if the file has none
    visual: Any  # trimesh visual, or None


def read_gltf(path: Path) -> list[Surface]:
    """Read the default scene of a .glb or .gltf file. Animations are ignored.

    Joints pose the skins, and default weights blend the morph targets (glTF 2.0 specification, sections 3.7.2
    and 3.7.3).
    Raises: MeshError, in one line without the file's name, if the file is damaged, requires an unsupported
        extension, or has no triangles.
    """
    try:
        with np.errstate(all="ignore"):  # an overflow is reported as a vertex that is not finite
            return _Reader(Document(path)).surfaces()
    except MeshError:
        raise
    except OSError as error:
        raise MeshError(f"cannot be read ({error.strerror or error})") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise MeshError(f"cannot be read: it is damaged ({reason})") from None


class _Reader:
    def __init__(self, document: Document) -> None:
        self.document, self.looks = document, Looks(document)
        self.counts: Counter[str] = Counter()  # numbers that the notes report
        self.joints: set[int] = set()
        self.primitives: dict[tuple[int, int], Primitive] = {}
        self.remaining_rows = MAX_ROWS
        self._require_extensions()

    def surfaces(self) -> list[Surface]:
        worlds = nodes.world_matrices(self.document)
        shown = nodes.shown_nodes(self.document)
        found: list[_Part] = []
        for number in shown:
            node = self.document.named("nodes", number)
            if "mesh" in node:
                found.extend(self._of_node(node, worlds, worlds[number]))
        if not self.document.entries("nodes"):  # a file without nodes is a library of meshes
            for number in range(len(self.document.entries("meshes"))):
                found.extend(self._of_node({"mesh": number}, worlds, np.eye(4)))
        notes = self._notes(shown)
        if not found:
            raise MeshError("; ".join(["there are no triangles in it", *notes]))
        return [
            surface_of(
                name, part.vertices, part.triangles, normals=part.normals, visual=part.visual, notes=notes
            )
            for part, name in zip(found, _unique(found), strict=True)
        ]

    def _of_node(self, node: Entry, worlds: FloatArray, world: FloatArray) -> Iterator[_Part]:
        mesh = self.document.named("meshes", node["mesh"])
        name = str(node.get("name") or mesh.get("name") or f"mesh {node['mesh']}")
        weights: Any = node.get("weights", mesh.get("weights", ()))
        instances = nodes.instance_matrices(self.document, node)
        if instances is not None:
            self.counts["instances"] += len(instances)
        for order, entry in enumerate(mesh["primitives"]):
            if entry.get("targets"):
                self.counts["morphed"] += 1
                self.counts["blended"] += any(weights)
            primitive = self._primitive(node["mesh"], order, entry)
            if not primitive.has_triangles:
                self.counts["skipped"] += 1
                continue
            positions, normals = primitive.vertices(weights)
            triangles = primitive.triangles(len(positions))
            copies = 1 if instances is None else len(instances)
            self._reserve_rows(copies * (len(positions) + len(triangles)))
            skinned = self._skin_matrices(node, primitive, worlds, len(positions))
            if skinned is not None and instances is not None:
                raise MeshError(
                    f"has {INSTANCING} on the skinned mesh {name!r}: remove the skin or the instances"
                )
            if skinned is not None:
                poses = skinned[None]
            else:
                poses = (world[None] if instances is None else world @ instances)[:, None]
            if len(triangles) and len(poses):
                part = _Part(name, positions, triangles, normals, self.looks.of(primitive))
                yield _posed(part, poses)

    def _primitive(self, mesh: int, order: int, entry: Entry) -> Primitive:
        """Return a primitive. Primitives are cached, because several nodes can use the same primitive."""
        key = mesh, order
        if key not in self.primitives:
            self.primitives[key] = Primitive(self.document, entry, f"primitive {order} of mesh {mesh}")
        return self.primitives[key]

    def _skin_matrices(
        self, node: Entry, primitive: Primitive, worlds: FloatArray, count: int
    ) -> FloatArray | None:
        """Return skinning matrices from vertices to the file's axes, (n, 4, 4), or None without a skin."""
        joints, weights = _influences(primitive)
        if "skin" not in node or not len(joints):
            return None
        skin = self.document.named("skins", node["skin"])
        for joint in skin["joints"]:
            self.document.named("nodes", joint)
        self.counts["skinned"] += 1
        self.joints.update(skin["joints"])
        matrices = worlds[skin["joints"]]
        if "inverseBindMatrices" in skin:
            inverse = self.document.values(skin["inverseBindMatrices"], "MAT4")
            if len(inverse) < len(matrices):
                raise MeshError(
                    f"cannot be read: skin {node['skin']} has only {len(inverse)} of {len(matrices)} matrices"
                )
            columns_first = inverse[: len(matrices)].reshape(-1, 4, 4)
            matrices = matrices @ columns_first.transpose(0, 2, 1)
        used = joints[weights > 0.0]
        if len(used) and used.max() >= len(matrices):
            raise MeshError(
                f"cannot be read: {primitive.name} refers to joint {used.max()} of {len(matrices)}"
            )
        weights[weights.sum(axis=1) <= 0.0, 0] = 1.0  # a vertex without weights follows its first joint
        weights /= weights.sum(axis=1, keepdims=True)
        blended = np.zeros((count, 4, 4))
        for column in range(joints.shape[1]):
            rows = np.flatnonzero(weights[:, column])
            blended[rows] += weights[rows, column, None, None] * matrices[joints[rows, column]]
        return blended

    def _reserve_rows(self, rows: int) -> None:
        self.remaining_rows -= rows
        if self.remaining_rows < 0:
            raise MeshError(f"has more than {MAX_ROWS:,} vertices and triangles: simplify it")

    def _require_extensions(self) -> None:
        required = [str(name) for name in self.document.entries("extensionsRequired")]
        for name in required:
            if name in MESHOPT:
                raise MeshError(f"is compressed with {name}: {copy_command(self.document.path)}")
            if name not in READ and not name.startswith(SHAPELESS):
                raise MeshError(f"requires the extension {name}, which is not supported: export it without")

    def _notes(self, shown: list[int]) -> tuple[str, ...]:
        counts, entries = self.counts, self.document.entries
        animations = [str(each.get("name", number)) for number, each in enumerate(entries("animations"))]
        names = ", ".join(animations[:5]) + (", ..." if len(animations) > 5 else "")
        blended = "blended by the file's default weights"
        unblended = "not applied: their default weights are 0"
        hidden = sum("mesh" in each for each in entries("nodes"))
        hidden -= sum("mesh" in entries("nodes")[number] for number in shown)
        notes = (
            (
                counts["skinned"],
                "primitive",
                f" with a skin, {_many(len(self.joints), 'joint')} in total: posed by the file's rest pose",
            ),
            (
                counts["morphed"],
                "primitive",
                f" with morph targets, {blended if counts['blended'] else unblended}",
            ),
            (len(animations), "animation", f" ({names[:200]}): not played"),
            (counts["instances"], "instance", f" by {INSTANCING}: read, as one mesh for each node"),
            (counts["skipped"], "primitive", " without triangles (points or lines): skipped"),
            (hidden, "node", " with a mesh outside the default scene or hidden: skipped"),
        )
        found = [_many(count, noun) + text for count, noun, text in notes if count]
        return (*found, *_extension_notes(entries("extensionsUsed")), *self.looks.notes)


def _extension_notes(names: list[Any]) -> list[str]:
    lists = (
        ("read", [str(name) for name in names if name in READ]),
        ("ignored", [str(name) for name in names if name not in READ]),
    )
    words = [f"{', '.join(each)} ({status})" for status, each in lists if each]
    return [f"extensions: {'; '.join(words)}"] if words else []


def _posed(part: _Part, poses: FloatArray) -> _Part:
    """Merge the instances of a part into one part.

    Args:
        poses: matrices to the file's axes, (instances, 1 or vertices, 4, 4).
    """
    linear, count = poses[..., :3, :3], len(part.vertices)
    vertices = np.einsum("...ij,...j->...i", linear, part.vertices) + poses[..., :3, 3]
    is_mirrored = np.asarray(np.linalg.det(linear) < 0.0)
    normals = None
    if part.normals is not None:  # normals transform by the inverse transpose, up to a factor
        cofactors = np.cross(linear[..., [1, 2, 0], :], linear[..., [2, 0, 1], :])
        moved = np.einsum("...ij,...j->...i", cofactors, part.normals)
        normals = np.where(is_mirrored[..., None], -moved, moved).reshape(-1, 3)
    is_reversed = np.broadcast_to(is_mirrored, vertices.shape[:2])[:, part.triangles].all(
        axis=2, keepdims=True
    )
    triangles = np.where(is_reversed, part.triangles[:, [0, 2, 1]], part.triangles)
    return replace(
        part,
        vertices=vertices.reshape(-1, 3),
        triangles=(triangles + count * np.arange(len(poses))[:, None, None]).reshape(-1, 3),
        normals=normals,
        visual=_repeated(part.visual, len(poses)),
    )


def _repeated(visual: Any, count: int) -> Any:
    """Repeat a visual for `count` copies of its vertices."""
    if visual is None or count == 1:
        return visual
    if visual.kind == "vertex":
        return type(visual)(vertex_colors=np.tile(visual.vertex_colors, (count, 1)))
    uv = None if visual.uv is None else np.tile(visual.uv, (count, 1))
    result = type(visual)(uv=uv, material=visual.material)
    for name, rows in visual.vertex_attributes.items():
        if name != "uv":
            result.vertex_attributes[name] = np.tile(rows, (count, 1))
    return result


def _influences(primitive: Primitive) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the joints of each vertex and their weights, (n, 4 k) each, or empty arrays (0, 0)."""
    joints, weights = [], []
    for group in range(16):
        numbers = primitive.rows(f"JOINTS_{group}", "VEC4")
        group_weights = primitive.values(f"WEIGHTS_{group}", "VEC4")
        if numbers is None or group_weights is None:
            break
        joints.append(numbers.astype(np.int64))
        weights.append(np.maximum(group_weights, 0.0))
    if not joints:
        return np.zeros((0, 0), np.int64), np.zeros((0, 0))
    return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)


def _unique(parts: list[_Part]) -> list[str]:
    """Return the names of the parts. Duplicate names get a number at the end."""
    found: dict[str, None] = {}
    last: Counter[str] = Counter()
    for part in parts:
        name = part.name
        while name in found:
            last[part.name] += 1
            name = f"{part.name} {last[part.name] + 1}"
        found[name] = None
    return list(found)


def _many(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
