"""A bar hangs from its upper end and is cut in two. The lower part falls and comes to rest on the floor.

The upper part springs up, because it no longer carries the lower part. Both parts have closed surfaces at the
cut.
"""

import numpy as np
from numpy.typing import NDArray

from engine_adapter import FixedStep
from taichi_soft import Body, BoxShape, Frame, Material, SoftBodyAsset, TetMesh, World, box
from taichi_soft.cli import main
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.colors import Color
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.props import Prop
from taichi_soft.render.stage import Paint

MATERIAL = Material(young=1.2e5, poisson=0.3, density=1000.0, damping_ratio=0.3)
SIZE = (0.6, 0.6, 2.0)  # edges of the bar [m]
HEIGHT = 2.05  # initial height of the bar's centre [m]
SEAM, SLOPE = (
    -0.3,
    0.1,
)  # plane of the cut: height above the bar's centre, measured on the bar's axis [m], and slope
CUT = np.array([0.0, 0.0, 1.53])  # point where the blade crosses the axis of the stretched bar [m]
ALONG = np.array([1.0, 0.0, SLOPE]) / np.hypot(1.0, SLOPE)  # direction of the blade's motion
ASIDE = np.array([0.0, 1.0, 0.0])  # direction of the blade's edge
WAY, WIDTH = 2.6, 0.3  # distance that the blade travels, and width of the blade [m]
BEGIN, PASSING = 0.9, 0.5  # start time and duration of the blade's pass [s]
STEP = FixedStep(dt=1 / 50, substeps=16)


class Knife:
    """Moves the blade through the bar. The bar is cut when half of the blade has left it."""

    def __init__(self, blade: Frame, stage: Stage) -> None:
        """Start with the blade next to the uncut bar."""
        self.blade, self.stage = blade, stage
        self.bar = stage.actors[0].body
        self.start = blade.position.astype(np.float64)
        self.fallen: Body | None = None
        self.parted = 0.0  # time of the cut [s]
        self.whole = self.below = 0.0  # mass of the bar, and mass below the blade at the time of the cut [kg]

    def __call__(self, world: World) -> None:
        """Move the blade before a step."""
        way = min(max((world.time - BEGIN) / PASSING, 0.0), 1.0) * WAY
        self.blade.move_to(self.start + way * ALONG)
        is_through = way > WAY / 2 + SIZE[0] / 2
        if is_through and self.fallen is None:
            self.whole = float(self.bar.masses.sum())
            self.below = _mass_below(self.bar)
            (self.fallen,) = self.bar.cut(plane=(CUT, np.cross(ALONG, ASIDE)))
            self.parted = world.time
            self.stage.actors[0].paint = _flesh(PALETTE[0])
            self.stage.actors.append(Actor(self.fallen, paint=_flesh(PALETTE[1])))

    def caption(self) -> str:
        """Return the masses of the parts as text for a frame."""
        pieces = [self.bar] if self.fallen is None else [self.bar, self.fallen]
        return " + ".join(f"{piece.masses.sum():.0f} kg" for piece in pieces)


def stage() -> Stage:
    """Make the stage: an unstretched bar, held at its upper end."""
    mesh = _leaning(box(SIZE, (8, 8, 20)))
    top = np.flatnonzero(mesh.vertices[:, 2] > SIZE[2] / 2 - 1e-6)
    asset = SoftBodyAsset(mesh, MATERIAL, pinned=top, spare_vertices=600)
    world = World(soft_contact=False, sleep_speed=0.0)
    world.reserve(asset, 2)
    bar = world.spawn(asset, position=(0.0, 0.0, HEIGHT))
    world.build()
    ceiling = world.add_frame((0.0, 0.0, HEIGHT + SIZE[2] / 2))
    axes = np.stack([ALONG, ASIDE, np.cross(ALONG, ASIDE)], axis=1)
    blade = world.add_frame(CUT - WAY / 2 * ALONG, axes)
    plate, steel = BoxShape((1.1, 1.1, 0.12)).surface(), BoxShape((WIDTH, 1.2, 0.02)).surface()
    props = [
        Prop((plate[0] + (0, 0, 0.06), plate[1]), ceiling),
        Prop(steel, blade, color=(0.95, 0.93, 0.88)),
    ]
    camera = Camera.framing((-1.5, -0.6, 0.0), (1.5, 0.6, 3.15), aspect=16 / 9, azimuth=-66, elevation=14)
    found = Stage("cut in two", world, [Actor(bar)], camera, STEP, 7.0, props=props, backdrop="paper")
    found.act = knife = Knife(blade, found)
    found.caption = knife.caption
    return found


def _leaning(bar: TetMesh) -> TetMesh:
    """Shear the mesh so that a boundary between layers is in the plane of the cut. This smooths the faces."""
    x, y, z = bar.vertices.T
    nearness = np.clip(1.0 - np.abs(z - SEAM) / 0.6, 0.0, 1.0)
    return TetMesh(np.stack([x, y, z + SLOPE * x * nearness], axis=1), bar.tets)


def _flesh(color: Color) -> Paint:
    """Return a function that paints the faces of the cut paler."""

    def paint(body: Body) -> NDArray[np.float32]:
        x, y, z = body.mesh.vertices.T
        is_within = (np.abs(x) < 0.49 * SIZE[0]) & (np.abs(y) < 0.49 * SIZE[1])
        is_cut = is_within & (np.abs(z - SEAM - SLOPE * x) < 1e-4)
        return np.where(is_cut[:, None], 0.35 * np.array(color) + 0.65, color).astype(np.float32)

    return paint


def _mass_below(body: Body) -> float:
    """Return the mass below the blade [kg].

    A tetrahedron that crosses the plane counts with the fraction of its height that is below the plane.
    """
    heights = np.sort((body.positions()[body.tets] - CUT) @ np.cross(ALONG, ASIDE), axis=1)
    share = np.clip(-heights[:, 0] / (heights[:, 3] - heights[:, 0]), 0.0, 1.0)
    return float(body.material.density * body.mesh.volumes @ share)


def proof(stage: Stage) -> float:
    """Return the mass of the fallen part, divided by the mass below the blade at the time of the cut."""
    knife = stage.act
    assert isinstance(knife, Knife)
    assert knife.fallen is not None
    return float(knife.fallen.masses.sum()) / knife.below


if __name__ == "__main__":
    main("demo", "cut")
