"""Write glTF 2.0: one node per clip, with a morph target for each distinct shape.

trimesh writes the first frame with materials and textures; pygltflib appends the motion. At each frame one
weight is 1 and all others are 0. Between two frames, interpolated weights blend the shapes of both frames.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bake.axes import y_up
from taichi_soft.bake.clip import Clip, Take
from taichi_soft.bake.clip_materials import visual_of

Interpolation = Literal["linear", "step"]

FLOAT, ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 5126, 34962, 34963  # constants of OpenGL
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}


def write_glb(take: Take, path: Path, interpolation: Interpolation) -> None:
    """Write the meshes of a take and their motion to a .glb file."""
    file = GlbFile(take)
    motion = _Motion(file, take, interpolation.upper())
    for clip in take.clips:
        motion.add(clip)
    motion.finish()
    file.save(path)


class GlbFile:
    """The first frame of a take as a glTF file, to which arrays can be added."""

    def __init__(self, take: Take) -> None:
        import trimesh
        from pygltflib import GLTF2

        scene = trimesh.Scene()
        for number, clip in enumerate(take.clips):
            mesh = trimesh.Trimesh(
                y_up(clip.positions[0]),
                clip.triangles,
                vertex_normals=y_up(clip.normals[0]),
                visual=visual_of(clip, number),
                process=False,
            )
            scene.add_geometry(mesh, node_name=clip.name, geom_name=clip.name)
        self.content = GLTF2.load_from_bytes(scene.export(file_type="glb", include_normals=True))
        self.content.asset.generator = "taichi-soft"
        self._blob = bytearray(self.content.binary_blob())
        self._nodes = {node.name: index for index, node in enumerate(self.content.nodes)}
        self._set_view_targets()

    def _set_view_targets(self) -> None:
        """Set the target of each buffer view. Trimesh omits the targets, but some importers require them."""
        for mesh in self.content.meshes:
            (primitive,) = mesh.primitives
            kinds = {accessor: ARRAY_BUFFER for accessor in vars(primitive.attributes).values()}
            for accessor, kind in {**kinds, primitive.indices: ELEMENT_ARRAY_BUFFER}.items():
                if accessor is not None:
                    self.content.bufferViews[self.content.accessors[accessor].bufferView].target = kind

    def node_of(self, clip: Clip) -> int:
        """Return the index of a clip's node."""
        return self._nodes[clip.name]

    def mesh_of(self, clip: Clip) -> Any:
        """Return the mesh of a clip's node."""
        return self.content.meshes[self.content.nodes[self.node_of(clip)].mesh]

    def add(self, rows: NDArray[Any], *, is_bounded: bool = False, is_vertices: bool = True) -> int:
        """Append an array to the file, and return the index of its accessor.

        Args:
            rows: (n,) or (n, 2 or 3), stored as float32.
            is_bounded: True to store minimum and maximum, which glTF requires for positions and times.
            is_vertices: True for one row per vertex.
        """
        from pygltflib import Accessor, BufferView

        array = np.ascontiguousarray(rows, dtype="<f4")
        columns = array.reshape(len(array), -1)
        view = BufferView(
            buffer=0,
            byteOffset=len(self._blob),
            byteLength=array.nbytes,
            target=ARRAY_BUFFER if is_vertices else None,
        )
        self._blob += array.tobytes()
        accessor = Accessor(
            bufferView=len(self.content.bufferViews),
            componentType=FLOAT,
            count=len(array),
            type=SHAPES[columns.shape[1]],
        )
        if is_bounded:
            accessor.min, accessor.max = columns.min(0).tolist(), columns.max(0).tolist()
        self.content.bufferViews.append(view)
        self.content.accessors.append(accessor)
        return len(self.content.accessors) - 1

    def save(self, path: Path) -> None:
        """Write the file to `path`. Raises: OSError."""
        self.content.buffers[0].byteLength = len(self._blob)
        self.content.set_binary_blob(self._blob)
        self.content.save_binary(str(path))


class _Motion:
    """The animation of a glTF file."""

    def __init__(self, file: GlbFile, take: Take, interpolation: str) -> None:
        from pygltflib import Animation

        self.file, self.take, self.interpolation = file, take, interpolation
        self.animation = Animation(name="bake")
        self.times: dict[tuple[float, ...], int] = {}
        self.weights: dict[tuple[int, ...], int] = {}

    def finish(self) -> None:
        """Add the animation to the file if anything moves."""
        if self.animation.channels:
            self.file.content.animations.append(self.animation)

    def add(self, clip: Clip) -> None:
        """Add the motion of a clip, and the interval in which its body is visible."""
        shapes, place = clip.targets()
        if shapes:
            self._add_targets(clip, shapes)
            times = self.take.times[clip.first : clip.end]
            self._add_channel(clip, "weights", times, self._weights(len(shapes), place), self.interpolation)
        if clip.first > 0 or clip.end < self.take.frame_count:
            self._hide(clip)

    def _add_targets(self, clip: Clip, shapes: list[int]) -> None:
        from pygltflib import Attributes

        mesh = self.file.mesh_of(clip)
        first = clip.positions[0], clip.normals[0]
        for index in shapes:
            position, normal = (
                y_up(rows.astype(np.float64) - start)
                for rows, start in zip((clip.positions[index], clip.normals[index]), first, strict=True)
            )
            mesh.primitives[0].targets.append(
                Attributes(POSITION=self.file.add(position, is_bounded=True), NORMAL=self.file.add(normal))
            )
        mesh.weights = [0.0] * len(shapes)
        mesh.extras = {"targetNames": [f"frame {clip.first + index}" for index in shapes]}

    def _weights(self, count: int, place: list[int]) -> int:
        """Add the weights of a clip: in each frame, 1 for its shape and 0 for all other shapes.

        Returns: the index of the accessor of these weights. Clips with equal weights share an accessor.
        """
        key = (count, *place)
        if key not in self.weights:
            rows = np.zeros((len(place), count), dtype=np.float32)
            moved = np.flatnonzero(np.asarray(place) >= 0)
            rows[moved, np.asarray(place)[moved]] = 1.0
            self.weights[key] = self.file.add(rows.ravel(), is_vertices=False)
        return self.weights[key]

    def _hide(self, clip: Clip) -> None:
        """Scale a body to zero in the frames in which it is absent."""
        changes = {0: clip.first == 0, clip.first: True}
        if clip.end < self.take.frame_count:
            changes[clip.end] = False
        sizes = np.repeat(np.array([changes[frame] for frame in changes], dtype=np.float32)[:, None], 3, 1)
        times = self.take.times[list(changes)]
        self._add_channel(clip, "scale", times, self.file.add(sizes, is_vertices=False), "STEP")

    def _add_channel(self, clip: Clip, path: str, times: Any, output: int, interpolation: str) -> None:
        from pygltflib import AnimationChannel, AnimationChannelTarget, AnimationSampler

        key = tuple(times)
        if key not in self.times:
            self.times[key] = self.file.add(np.asarray(times), is_bounded=True, is_vertices=False)
        target = AnimationChannelTarget(node=self.file.node_of(clip), path=path)
        self.animation.channels.append(AnimationChannel(sampler=len(self.animation.samplers), target=target))
        self.animation.samplers.append(
            AnimationSampler(input=self.times[key], output=output, interpolation=interpolation)
        )
