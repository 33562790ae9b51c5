"""Toy elephants fall down steps and flap their ears. Tetrahedral cages move an artist's textured mesh.

Ears and trunks keep swinging after a body has landed. The texture follows the skin.
"""

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from engine_adapter import FixedStep
from taichi_soft import Body, BoxShape, Contact, Material, SoftBodyAsset, World
from taichi_soft.cli import main
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render import Camera
from taichi_soft.render.film import Actor, Stage

TOY = ASSETS / "elephant.glb"
HEIGHT = 0.5  # height of the toy in its file [m]
CELLS = 8  # cells of the cages along their longest side
DENSITY, POISSON, DAMPING = 200.0, 0.4, 0.08  # density [kg/m^3], Poisson's ratio, damping ratio
STEPS, RISE, TREAD, WIDTH = 3, 0.26, 0.66, 2.7  # number of steps, and their height, depth and width [m]
STONE = ((0.80, 0.74, 0.68), (0.88, 0.82, 0.75), (0.95, 0.90, 0.83))  # colours, lowest step first
THICKNESS = 0.01  # contact thickness of the bodies [m]
DRAG = 0.8  # damping rate [1/s]
STILL = 0.3  # speed below which a toy counts as resting [m/s]; toys land at about 4 m/s
STEP = FixedStep(dt=1 / 200)  # short, so that retries after strong compression are cheap

HERD = (
    (0.76, 3.0e4, "rgb", (0.0, 0.22, 0.06), (0.0, -0.45, 0.0), -0.3),
    (0.60, 2.0e4, "brg", (-0.80, 0.20, 0.36), (0.1, -0.5, 0.0), -0.8),
    (0.60, 4.0e4, "grb", (0.82, 0.20, 0.56), (-0.1, -0.4, 0.0), 0.6),
    (0.46, 2.0e4, "bgr", (-0.34, -0.30, 0.90), (0.1, -0.2, 0.0), -1.0),
    (0.46, 2.0e4, "rbg", (0.36, 0.05, 1.10), (0.1, -0.6, 0.0), 0.5),
)
"""Height [m], Young's modulus [Pa], dye, position relative to the edge of the top step [m], initial velocity
[m/s] and forward spin [rad/s] of each toy."""


def toy(height: float, dye: str) -> trimesh.Scene:
    """Load the toy, scale it to a height [m], and recolour its cloth.

    The colour channels of pixels with more blue than red are reordered to `dye`, such as "brg".
    """
    scene = trimesh.load_scene(TOY, process=False)
    for mesh in scene.geometry.values():
        mesh.apply_scale(height / HEIGHT)
        look = mesh.visual.material
        plain = np.asarray(look.baseColorTexture.convert("RGB"), dtype=np.float32)
        share = np.clip((plain[..., 2:] - plain[..., :1]) / 50.0, 0.0, 1.0)
        other = plain[..., ["rgb".index(channel) for channel in dye]]
        look.baseColorTexture = Image.fromarray((plain + share * (other - plain)).astype(np.uint8))
    return scene


def stage() -> Stage:
    """Make the stage: upright elephants above the steps."""
    world = World(friction=0.8)
    colors = {}
    for i in range(STEPS):
        depth = TREAD * (STEPS - i)
        step = world.add_collider(
            BoxShape((WIDTH, depth, RISE)), position=(0.0, -depth / 2, RISE * (i + 0.5)), friction=0.8
        )
        colors[step] = STONE[i % len(STONE)]
    contact = Contact(friction=0.7, thickness=THICKNESS)
    for height, young, dye, place, _, _ in HERD:
        material = Material(young, POISSON, DENSITY, damping_ratio=DAMPING)
        asset = SoftBodyAsset.from_surface(toy(height, dye), material, cells=CELLS, up="y", contact=contact)
        world.add_body(asset, position=np.add((0.0, -TREAD, STEPS * RISE), place))
    world.build()
    for body, (_, _, _, _, velocity, turn) in zip(world.bodies, HERD, strict=True):
        body.set_linear_damping(DRAG)
        body.set_velocity(velocity, (turn, 0.0, 0.0))
    camera = Camera.framing(
        (-1.3, -2.75, 0.0), (1.3, -0.4, 2.0), aspect=16 / 9, azimuth=-76, elevation=13, margin=1.0
    )
    actors = [Actor(body) for body in world.bodies]
    return Stage("toy elephants", world, actors, camera, STEP, 5.0, collider_colors=colors, backdrop="meadow")


def ear_span(body: Body) -> float:
    """Return the ratio of the distance between the tips of the ears to their distance at rest."""
    rest, now = body.mesh.vertices, body.positions()
    x = rest[:, 0]
    left, right = x < 0.85 * x.min(), x > 0.85 * x.max()
    lengths = [np.linalg.norm(rows[left].mean(axis=0) - rows[right].mean(axis=0)) for rows in (rest, now)]
    return float(lengths[1] / lengths[0])


def ground_below(places: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the height (n,) of the step or the floor below each position in `places`, (n, 3) [m]."""
    x, y, _ = places.T
    is_over = (np.abs(x) < WIDTH / 2) & (y < 0.0) & (y > -STEPS * TREAD)
    return np.where(is_over, RISE * np.ceil(STEPS + y / TREAD), 0.0)


def proof(stage: Stage) -> float:
    """Return the number of elephants that rest on the steps or the floor without penetrating them."""
    count = 0
    for body in stage.world.bodies:
        rows = body.positions()
        speed = np.linalg.norm(body.momentum()) / body.masses.sum()
        gap = float((rows[:, 2] - ground_below(rows)).min())
        count += speed < STILL and -0.01 < gap < 0.03
    return float(count)


if __name__ == "__main__":
    main("demo", "elephants")
