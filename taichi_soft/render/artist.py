"""Draw the frames of a stage, with text overlays."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.skin_mesh import SkinMesh
from taichi_soft.render import Renderer, Surface, draw_color_scale, draw_labels, draw_legend, draw_text
from taichi_soft.render.motion_blur import mean_picture
from taichi_soft.render.skin_looks import texture_picture, vertex_colors
from taichi_soft.render.stage import Actor
from taichi_soft.render.take import Take, skins_of
from taichi_soft.render.texture import Texture
from taichi_soft.render.tube import Tube

_RECENT = 25
"""Number of recent frames. The displayed speed is computed from their median step time."""

LABEL_DISTANCE = 1.2
"""Distance from a body's centre to its label, as a multiple of half the body's width at rest."""


def speed_of(times: Sequence[float], fps: float) -> str:
    """Return the simulation speed as text, such as "1.5 x real time", or "" before the second frame.

    The speed is computed from the median step time of the last frames, so that one slow frame has no effect.

    Args:
        times: step time of each frame [s]. The first frame makes no step and is ignored.
        fps: frames per second of world time.
    """
    recent = times[1:][-_RECENT:]
    if not recent:
        return ""
    factor = 1.0 / fps / float(np.median(recent))
    return f"{factor:.{0 if factor >= 10 else 1 if factor >= 0.1 else 2}f} x real time"


THINNEST = 0.05
"""Smallest radius of a drawn rope, relative to its mean edge, so that a thin rope can be seen."""


class Artist:
    """Draws a take and the text overlays of its stage.

    Args:
        size: width and height [pixels].
        rate: frames per second of world time.
        slow: slow-motion factor of the film.
        stats: True to also show the world's time and the speed of the last steps.

    Attributes:
        times: drawing time of each frame [s].
    """

    def __init__(self, take: Take, size: tuple[int, int], rate: float, slow: float, stats: bool) -> None:
        self.take = take
        self.rate, self.slow, self.stats = rate, slow, stats
        stage = take.stage
        self.renderer = Renderer(
            *size, camera=take.camera(), floor=stage.world.settings.floor, backdrop=stage.backdrop
        )
        self.times: list[float] = []
        self._spent = 0.0
        self._surfaces: dict[tuple[int, int], list[Surface]] = {}  # surfaces, by actor and topology version
        # Images and their textures by the id of the image. Storing the image keeps its id unique.
        self._textures: dict[int, tuple[Any, Texture]] = {}

    def draw(self) -> NDArray[np.uint8]:
        """Draw the current state of the take without text. Returns: sRGB, uint8 (height, width, 3)."""
        start = time.perf_counter()
        take = self.take
        surfaces = take.scenery.at(take.adapter.alpha).copy()
        for actor, rows, own in zip(take.stage.actors, take.positions, take.normals, strict=True):
            at = 0
            for surface in self._surfaces_of(actor):
                its = slice(at, at + surface.vertex_count)
                at += surface.vertex_count
                surface.positions = rows[its]
                if surface.normals is not None:
                    surface.normals = own[its]
                if actor.paint:
                    surface.color = actor.paint(actor.body)
                surfaces.append(surface)
        self.renderer.camera = take.camera()
        picture = self.renderer.render(surfaces)
        self._spent += time.perf_counter() - start
        return picture

    def finish(self, pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
        """Average the subframes of a frame and draw the text. Returns: sRGB, uint8 (height, width, 3).

        If there is only one subframe, it is changed in place.
        """
        start = time.perf_counter()
        picture = mean_picture(pictures)
        stage = self.take.stage
        self._draw_labels(picture)
        lines = [stage.title]
        if self.stats:
            speed = speed_of(self.take.times, self.rate)
            lines.append(f"t = {self.take.adapter.time:.2f} s   {speed}".rstrip())
        if self.slow > 1.0:
            lines.append(f"shown {self.slow:g} x slower")
        if stage.caption:
            lines.append(stage.caption())
        draw_text(picture, [line for line in lines if line])
        if stage.scale:
            draw_color_scale(picture, stage.scale, corner="top right")
        if stage.legend:
            draw_legend(picture, stage.legend, corner="top right")
        self.times.append(self._spent + time.perf_counter() - start)
        self._spent = 0.0
        return picture

    def _surfaces_of(self, actor: Actor) -> list[Surface]:
        """Return the surfaces of an actor's skins, or of its body if it has no skin.

        A cut replaces the surfaces.
        """
        key = id(actor), actor.body.topology_version
        if key not in self._surfaces:
            skins = [self._skin_surface(mesh, actor) for mesh in skins_of(actor)]
            self._surfaces[key] = skins or [self._body_surface(actor)]
        return self._surfaces[key]

    @staticmethod
    def _body_surface(actor: Actor) -> Surface:
        """Make the surface of a body, or the tube of a body without triangles."""
        if len(actor.body.mesh.surface):
            return Surface.of(actor.body.mesh, color=actor.color, look=actor.look)
        mesh, (_, thickness, edge) = actor.body.mesh, actor.body.asset.surface_row
        radius = max(0.5 * thickness, THINNEST * edge)
        return Tube(mesh.vertices, mesh.edges, radius, color=actor.color, look=actor.look)

    def _skin_surface(self, mesh: SkinMesh, actor: Actor) -> Surface:
        """Make the surface of a skin, with the colours and the texture of the mesh if there are any."""
        picture, texture = texture_picture(mesh.visual, mesh.vertex_count), None
        if picture is not None:
            if id(picture) not in self._textures:
                self._textures[id(picture)] = picture, Texture(np.asarray(picture.convert("RGB")))
            texture = self._textures[id(picture)][1]
        nowhere = np.zeros((mesh.vertex_count, 3), dtype=np.float32)
        return Surface(
            nowhere,
            mesh.triangles,
            color=vertex_colors(mesh.visual, mesh.vertex_count, actor.color),
            normals=nowhere,
            texture=texture,
            uv=None if texture is None else mesh.visual.uv,
            look=actor.look,
        )

    def _draw_labels(self, picture: NDArray[np.uint8]) -> None:
        """Draw each body's caption on the floor in front of the body."""
        stage = self.take.stage
        named = [(a, rows) for a, rows in zip(stage.actors, self.take.positions, strict=True) if a.label]
        if not named:
            return
        floor, camera = stage.world.settings.floor, self.renderer.camera
        forward = np.subtract(camera.eye, camera.target)[:2]
        forward = forward / max(float(np.linalg.norm(forward)), 1e-9)
        feet = np.array([rows.mean(axis=0) for _, rows in named], dtype=np.float64)
        for foot, (actor, rows) in zip(feet, named, strict=True):
            half = float(np.ptp(actor.body.mesh.vertices, axis=0)[:2].max()) / 2
            foot[:2] += LABEL_DISTANCE * half * forward
            foot[2] = rows[:, 2].min() if floor is None else floor
        places = camera.project(feet, self.renderer.width, self.renderer.height)
        draw_labels(picture, [actor.label for actor, _ in named], places)
