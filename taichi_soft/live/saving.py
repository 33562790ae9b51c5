"""Downloads for visitors: the scene's script with a snapshot, and a film of the last seconds."""

from __future__ import annotations

import io
import os
import zipfile
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.core.errors import StateError
from taichi_soft.live.drawn import Drawn
from taichi_soft.live.frame_file import Frame
from taichi_soft.live.scene import SceneSource

_RESTORED = """\

world.restore(Path(__file__).with_name("scene.snapshot").read_bytes())
assert world.state_hash() == {hash!r}, "this needs the same version of taichi-soft and the unchanged script"

DT, SUBSTEPS = {dt!r}, {substeps!r}  # of a step: seconds, and parts

if __name__ == "__main__":
    for _ in range(60):{act}
        world.step(DT, SUBSTEPS)
    print(f"t = {{world.time:.3f}} s, state {{world.state_hash()}}")
"""


def saved_script(source: SceneSource, state_hash: str, dt: float, substeps: int) -> str:
    """Return a script that restores the world from a snapshot in the same folder, and makes 60 steps."""
    title = f'"""The scene {source.title!r}, saved by `taichi-soft live`."""\n\n'
    script = source.script(is_alone=True)
    act = "\n        if act is not None:\n            act(world)" if source.kind == "demo" else ""
    return title + script + _RESTORED.format(hash=state_hash, dt=dt, substeps=substeps, act=act)


def packed(script: str, snapshot: bytes, source: SceneSource) -> bytes:
    """Pack the script, its snapshot and the files that the script names. Returns: content of a .zip file."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene.py", script)
        archive.writestr("scene.snapshot", snapshot)
        for path in [*source.meshes, *([source.name] if source.kind == "script" else [])]:
            archive.write(path, f"files/{Path(path).name}")
    return out.getvalue()


FILM_FPS = 30.0

LOW_PRIORITY = 10
"""Nice value of the process that renders a film, from 0 to 19."""

KEPT = 10.0
"""Length of a film [s]. Frames of this period are stored."""

MOST_KEPT = 2**28
"""Largest size of the frames stored for a film [bytes]. If a world has many vertices, the film is shorter."""


class Recent:
    """Frames of the last `KEPT` seconds, for a film."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, int, Any]] = deque()
        self._due = 0.0

    def add(self, now: float, moment: float, drawn: Drawn, frame: Frame) -> None:
        """Store a frame, unless the last stored frame is too recent.

        Args:
            now: current time [s].
            moment: world time of the frame [s].
        """
        if now < self._due:
            return
        if self._rows and moment < self._rows[-1][0]:
            self._rows.clear()  # the world has been restored to an earlier state
        self._rows.append((moment, drawn.version, (frame.positions.copy(), frame.poses.copy())))
        most = min(KEPT * FILM_FPS, MOST_KEPT / (12 * max(drawn.vertex_count, 1)))
        while len(self._rows) > most:
            self._rows.popleft()
        self._due = now + 1.0 / FILM_FPS - 0.002

    def clear(self) -> None:
        """Drop all frames."""
        self._rows.clear()

    def rows(self) -> list[tuple[float, int, Any]]:
        """Return the frames in order, each as (world time [s], version of the meshes, (positions, poses))."""
        return list(self._rows)


def film_frames(path: Path, recent: Sequence[tuple[float, int, Any]], drawn: Drawn) -> None:
    """Write the input of `film_file`: the current meshes, and the recent frames of these meshes."""
    header, arrays = drawn.described()
    own = [(moment, rows) for moment, version, rows in recent if version == drawn.version]
    if not own:
        raise StateError("nothing has moved yet, so there is no film: let the world run first")
    # Each frame of the film shows the last stored frame that is not later than the frame of the film.
    moments = np.array([moment for moment, _ in own])
    shown = np.arange(moments[0], moments[-1] + 1e-9, 1.0 / FILM_FPS)
    frames = [own[i][1] for i in np.searchsorted(moments, shown + 1e-9, side="right") - 1]
    camera = header["camera"]
    rows: dict[str, Any] = dict(
        positions=np.array([positions for positions, _ in frames], np.float32),
        poses=np.array([poses for _, poses in frames], np.float32),
        floor=np.array([np.nan if header["floor"] is None else header["floor"]]),
        camera=np.array([*camera["eye"], *camera["target"], camera["fov"]]),
        collider_counts=np.array(
            [(each["vertices"], each["triangles"]) for each in header["colliders"]], np.int64
        ).reshape(-1, 2),
        **arrays,
    )
    np.savez(path, **rows)


def film_file(frames: str, path: str, fps: float, size: tuple[int, int] = (854, 480)) -> int:
    """Render a film from the output of `film_frames`, at low priority, because a live world runs meanwhile.

    This lowers the priority of the whole process, so call it in a dedicated process.
    Returns: number of frames.
    """
    from taichi_soft import init
    from taichi_soft.render import Camera, Renderer, Surface, VideoWriter
    from taichi_soft.render.props import SLATE

    with suppress(AttributeError):  # Windows has no nice values
        os.nice(LOW_PRIORITY)
    init("cpu")
    with np.load(frames) as held:
        data = {name: held[name] for name in held.files}
    camera = data["camera"]
    floor = float(data["floor"][0])
    view = Camera(tuple(camera[:3]), tuple(camera[3:6]), fov_degrees=float(camera[6]))
    bodies = Surface(
        data["positions"][0],
        data["triangles"].astype(np.int32),
        color=data["colors"].astype(np.float32) / 255.0,
    )
    solids, at_vertex, at_triangle = [], 0, 0
    for vertices, triangles in data["collider_counts"]:
        rows = data["collider_vertices"][at_vertex : at_vertex + vertices]
        faces = data["collider_triangles"][at_triangle : at_triangle + triangles].astype(np.int32)
        solids.append((rows, Surface(rows, faces, color=SLATE)))
        at_vertex, at_triangle = at_vertex + int(vertices), at_triangle + int(triangles)
    with VideoWriter(path, fps=fps, size=size) as writer:
        renderer = Renderer(*size, camera=view, floor=None if np.isnan(floor) else floor)
        for positions, poses in zip(data["positions"], data["poses"], strict=True):
            bodies.positions = positions
            for (rows, surface), pose in zip(solids, poses, strict=True):
                surface.positions = rows @ pose[:9].reshape(3, 3).T + pose[9:]
            writer.write(renderer.render([*(surface for _, surface in solids), bodies]))
    return len(data["positions"])
