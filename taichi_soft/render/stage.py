"""What a film shows: a world, its bodies and how they look, and who looks at them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine_adapter import FixedStep
from taichi_soft.contact.collider import Collider
from taichi_soft.render import PALETTE, Camera, ColorScale, Look
from taichi_soft.render.backdrop import Backdrop, BackdropName
from taichi_soft.render.camera_moves import Follow, Orbit
from taichi_soft.render.colors import Color
from taichi_soft.render.look import LookName
from taichi_soft.render.props import Prop
from taichi_soft.world.body import Body
from taichi_soft.world.world import World

Paint = Callable[[Body], NDArray[np.float32]]


@dataclass
class Actor:
    """A body and how it is drawn."""

    body: Body
    color: Color = PALETTE[0]
    paint: Paint | None = None  # vertex colours (n, 3) after the last step, instead of `color`
    label: str = ""  # on the floor in front of the body
    world: World | None = None  # that it lives in, where that is not the stage's
    shift: ArrayLike = (0.0, 0.0, 0.0)  # from where it is to where it is drawn, (3,) [m]
    look: Look | LookName = Look.MATTE  # what it seems to be made of


@dataclass
class Stage:
    """A built world, how it is stepped and how it is seen. Its colliders are drawn without being named.

    Words stand in the corners, and are short: they have to be legible in a film of 480 pixels.
    """

    title: str
    world: World
    actors: list[Actor]  # `act` may add pieces that fell off
    camera: Camera | Orbit | Follow
    step: FixedStep
    seconds: float  # of the world that a film of it shows
    act: Callable[[World], object] | None = None  # before every fixed step: moves colliders, grabs, throws
    props: list[Prop] = field(default_factory=list)
    caption: Callable[[], str] | None = None  # a further line in the corner, after the last step
    scale: ColorScale | None = None  # what the colours of bodies mean, shown as a bar
    legend: list[tuple[Color, str]] = field(default_factory=list)  # colours of bodies and what these are
    collider_colors: dict[Collider, Color] = field(default_factory=dict)  # of those that are to stand out
    backdrop: Backdrop | BackdropName = Backdrop.DAY  # sky and floor
