"""The content of a film: a world, its bodies and their looks, and a camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine_adapter import FixedStep
from taichi_soft.contact.collider import Collider
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.render import PALETTE, Camera, ColorScale, Look
from taichi_soft.render.backdrop import Backdrop, BackdropName
from taichi_soft.render.camera_moves import Follow, Orbit
from taichi_soft.render.colors import Color
from taichi_soft.render.look import LookName
from taichi_soft.render.props import Prop
from taichi_soft.world.body import Body
from taichi_soft.world.world import World

Paint = Callable[[Body], NDArray[np.float32]]

FIT_MARGIN = 1.3
"""Size of the default view relative to the box of the bodies."""


@dataclass
class Actor:
    """A body of a stage and its appearance.

        Actor(body, (0.9, 0.3, 0.2), look="jelly", label="25 kPa")

    A body made by `SoftBodyAsset.from_surface` is drawn as the artist's mesh, with the colours and the
    texture of the mesh file if there are any.
    """

    body: Body  # body of a built world
    color: Color = PALETTE[0]  # sRGB from 0 to 1; the first colour of `PALETTE` by default
    paint: Paint | None = None  # function that returns colours (n, 3) of all vertices, instead of `color`
    label: str = ""  # caption on the floor in front of the body, plain ASCII
    world: World | None = None  # world of the body; None for the world of the stage
    shift: ArrayLike = (0.0, 0.0, 0.0)  # offset of the drawn body from its position, (3,) [m]
    look: Look | LookName = Look.MATTE  # "matte", "jelly" or "cloth"


@dataclass
class Stage:
    """A built world with its step length, its camera and its looks: the input of `film`.

        stage = Stage.of(world, seconds=4.0)
        stage.camera = Orbit(stage.camera, period=8.0)
        film(stage, "balls.mp4")

    All colliders are drawn, level floors as a chequered plane. All texts must be plain ASCII. Keep them short
    enough for a film that is 480 pixels wide.
    """

    title: str  # text in the corner of the image
    world: World  # built world
    actors: list[Actor]  # bodies to draw; `act` may add some
    camera: Camera | Orbit | Follow  # fixed, orbiting a point, or following a body
    step: FixedStep  # length of a step, its substeps, and the largest number of steps of a frame
    seconds: float  # world time of a film [s]
    act: Callable[[World], object] | None = None  # called before every step, to move colliders, grab or throw
    props: list[Prop] = field(default_factory=list)  # solid objects that move with colliders or frames
    caption: Callable[[], str] | None = None  # function that returns another line of text for each frame
    scale: ColorScale | None = None  # scale that the colours of bodies show, drawn as a colour bar
    legend: list[tuple[Color, str]] = field(default_factory=list)  # colours and their meaning
    collider_colors: dict[Collider, Color] = field(default_factory=dict)  # colours of highlighted colliders
    backdrop: Backdrop | BackdropName = Backdrop.DAY  # sky and floor

    @classmethod
    def of(
        cls,
        world: World,
        *,
        title: str = "",
        seconds: float = 5.0,
        step: FixedStep | None = None,
        act: Callable[[World], object] | None = None,
    ) -> Stage:
        """Make a stage that shows all bodies of a world in different colours.

        You can change the returned stage before a film begins.
        Args:
            world: a built world. Bodies without triangles, such as ropes, are drawn as tubes.
            title: text in the corner; none by default.
            seconds: world time of a film [s].
            step: length of a step; `FixedStep()` (1/60 s) by default.
            act: called with the world before every step.
        Raises: OptionError for an argument that is not a world, or a world without bodies to draw; StateError
            before `build`.
        """
        if not isinstance(world, World):
            raise OptionError(f"world must be a taichi_soft.World, got {type(world).__name__}")
        if not world.is_built:
            raise StateError("the world is not built: call world.build() before Stage.of(world)")
        drawn = list(world.bodies)
        if not drawn:
            raise OptionError("the world has no bodies to draw: spawn one first")
        actors = [Actor(body, PALETTE[i % len(PALETTE)]) for i, body in enumerate(drawn)]
        rows = np.concatenate([body.positions() for body in drawn]).astype(np.float64)
        low, high = rows.min(axis=0), rows.max(axis=0)
        floor = world.settings.floor
        low[2] = low[2] if floor is None else min(low[2], floor)
        camera = Camera.framing(low, high, aspect=16 / 9, margin=FIT_MARGIN)
        return cls(title, world, actors, camera, FixedStep() if step is None else step, seconds, act)
