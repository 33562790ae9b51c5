"""Playable scenes of the documentation. Each public function makes one scene.

`controls` are plain data for `game.js`: sliders that set gravity, damping or wind, or move an object `along`
or `about` a direction, and buttons that spawn or push bodies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from taichi_soft import (
    BoxShape,
    Contact,
    Frame,
    Material,
    MeshShape,
    SoftBodyAsset,
    SphereShape,
    SpringMaterial,
    TetMesh,
    World,
    box,
    cloth,
    cloth_constants,
    cylinder,
    sphere,
    torus,
)
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render import PALETTE, Camera

CORAL, TEAL, HONEY, PERIWINKLE, LEAF, ROSE, SKY, CLAY = PALETTE
STEPS = 300
"""Number of steps in the recording with which a browser compares its results."""


@dataclass
class Scene:
    """A world and the data that a page needs to show it.

    The docstring of the function that makes the scene contains the title and the text.
    """

    world: World  # a built world, created with `record=STEPS`
    camera: Camera
    controls: list[dict[str, Any]]
    colors: list[Any]  # colour of each slot, sRGB from 0 to 1
    names: dict[Any, str] = field(default_factory=dict)  # names of assets, bodies, colliders, frames
    textures: Mapping[SoftBodyAsset, Any] = field(default_factory=dict)  # PIL images
    props: Mapping[Frame, Any] = field(default_factory=dict)  # (vertices, triangles) drawn with a frame


def _gravity(most: float = 2.0) -> dict[str, Any]:
    """Return a slider for gravity, in multiples of the Earth's gravity."""
    return {
        "kind": "gravity",
        "label": "Gravity",
        "min": 0,
        "max": most,
        "step": 0.1,
        "value": 1,
        "unit": "g",
    }


def _damping(value: float = 0.0) -> dict[str, Any]:
    """Return a slider for the linear damping of all bodies [1/s]."""
    return {
        "kind": "damping",
        "label": "Damping",
        "min": 0,
        "max": 5,
        "step": 0.1,
        "value": value,
        "unit": "1/s",
    }


def jelly() -> Scene:
    """Pull a jelly.

    Pull the pudding, or drop berries on it. Its bottom is fixed, and its Young's modulus is 20 kPa.
    """
    world = World(friction=0.8, record=STEPS)
    contact = Contact(friction=0.8, thickness=0.01)
    mesh = _pudding()
    material = Material(young=2e4, poisson=0.42, density=500.0, damping_ratio=0.05)
    foot = np.flatnonzero(mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + 1e-6)
    pudding = SoftBodyAsset(mesh, material, contact=contact, pinned=foot)
    berry = SoftBodyAsset(
        sphere(0.11, 2), Material(young=5e4, poisson=0.3, density=400.0, damping_ratio=0.1), contact=contact
    )
    world.reserve(berry, 6)
    body = world.add_body(pudding, position=(0, 0, 0.36))
    world.build()
    drop = {"kind": "spawn", "label": "Drop a berry", "asset": "berry", "at": [0, 0, 1.6], "spread": 0.25}
    return Scene(
        world,
        Camera.framing((-0.65, -0.65, 0), (0.65, 0.65, 0.95), aspect=1.6, elevation=16),
        [drop, _gravity(), _damping()],
        [ROSE if each is pudding else CORAL for each in _assets(world)],
        {pudding: "pudding", berry: "berry", body: "jelly"},
    )


def _assets(world: World) -> list[SoftBodyAsset]:
    """Return the asset of each slot."""
    from taichi_soft.world.world import context_of_world

    return list(context_of_world(world).slots.assets)


def _pudding() -> TetMesh:
    """Make a fluted cylinder that narrows towards its top."""
    height, flutes = 0.7, 8
    mesh = cylinder(0.55, height, rings=4, layers=6)
    x, y, z = mesh.vertices.T
    share = z / height + 0.5
    wave = 1 + 0.09 * np.cos(flutes * np.arctan2(y, x)) * np.hypot(x, y) / 0.55
    scale = wave * (1 - 0.35 * share - 0.1 * np.clip(share - 0.7, 0, 1) ** 2 / 0.09)
    return TetMesh(np.column_stack([x * scale, y * scale, z]), mesh.tets)


def bowl() -> Scene:
    """Tip the bowl.

    Tip the bowl with its sliders until it is empty, or pull a body out.
    """
    world = World(friction=0.5, record=STEPS)
    material = Material(young=1e5, poisson=0.3, density=500.0, damping_ratio=0.1)
    shapes = [sphere(0.3, 3), box((0.5, 0.5, 0.5), (3, 3, 3)), torus(0.3, 0.14, rings=1, segments=16)]
    assets = [
        SoftBodyAsset(each, material, contact=Contact(friction=0.4, thickness=0.015)) for each in shapes
    ]
    bowl = world.add_collider(MeshShape(_bowl(1.25, 0.12)), position=(0, 0, 1.38), friction=0.4)
    for i in range(8):
        angle, out = 2.1 * i, 0.55 if i % 4 else 0.0
        place = (out * np.cos(angle), out * np.sin(angle), 1.0 + 0.75 * (i // 4))
        world.add_body(assets[i % 3], position=place)
    world.build()
    tip = {
        "kind": "move",
        "collider": "bowl",
        "min": -60,
        "max": 60,
        "step": 1,
        "value": 0,
        "unit": "°",
        "rate": 60,
    }
    return Scene(
        world,
        Camera.framing((-1.5, -1.5, 0), (1.5, 1.5, 2.1), aspect=1.6, elevation=32, margin=1.0),
        [
            {**tip, "label": "Left, right", "about": [0, 1, 0]},
            {**tip, "label": "Back, forth", "about": [1, 0, 0]},
            _gravity(),
        ],
        [PALETTE[i] for i in range(8)],
        {bowl: "bowl"},
    )


def _bowl(radius: float, wall: float) -> trimesh.Trimesh:
    """Make half a hollow ball with a round rim, open at the top. The origin is the centre of the opening."""
    angles = np.linspace(0, np.pi / 2, 17)
    outer = (radius + wall) * np.column_stack([np.sin(angles), -np.cos(angles)])
    inner = radius * np.column_stack([np.sin(angles), -np.cos(angles)])[::-1]
    bend = np.linspace(0, np.pi, 6)[1:-1]
    rim = np.column_stack([radius + wall / 2 * (1 + np.cos(bend)), wall / 2 * np.sin(bend)])
    return trimesh.creation.revolve(np.concatenate([outer, rim, inner]), sections=48)


def elephant() -> Scene:
    """Drop an elephant.

    Drop elephants onto the steps. The scene holds four elephants; a fifth replaces the first.
    """
    world = World(friction=0.8, record=STEPS)
    depth, rise, width = 0.6, 0.24, 2.4
    for i in range(3):
        deep = depth * (3 - i)
        world.add_collider(
            BoxShape((width, deep, rise)), position=(0, -deep / 2, rise * (i + 0.5)), friction=0.8
        )
    toy = trimesh.load_scene(ASSETS / "elephant.glb", process=False)
    (mesh,) = toy.geometry.values()
    mesh.apply_scale(1.4)
    material = Material(4e4, 0.4, 200.0, damping_ratio=0.08)
    asset = SoftBodyAsset.from_surface(
        toy, material, cells=7, up="y", contact=Contact(friction=0.7, thickness=0.01)
    )
    world.reserve(asset, 4)
    for x in (-0.5, 0.5):
        world.spawn(asset, position=(x, -0.4, 1.2 + 0.6 * x), angular_velocity=(-0.4, 0, x))
    world.build()
    for body in world.bodies:
        body.set_linear_damping(0.8)
    drop = {
        "kind": "spawn",
        "label": "Drop an elephant",
        "asset": "elephant",
        "at": [0, -0.55, 1.7],
        "spread": 0.5,
    }
    blast = {"kind": "blast", "label": "Throw them up", "at": [0, -1.2, -0.3], "impulse": 60, "radius": 3}
    return Scene(
        world,
        Camera.framing((-1.3, -2.4, 0.0), (1.3, 0.0, 1.8), aspect=1.6, azimuth=-68, elevation=16),
        [drop, blast, _gravity(), _damping(0.8)],
        [(1.0, 1.0, 1.0)] * 4,
        {asset: "elephant"},
        {asset: mesh.visual.material.baseColorTexture.convert("RGB")},
    )


def flag() -> Scene:
    """Let the wind blow.

    Set the wind along and across the flag, and pull its corners.
    """
    cells = (22, 16)
    mesh = cloth((1.65, 1.2), cells, 0.3)
    stiffness = cloth_constants(mesh, cells, tensile=400.0, shear=150.0, bend=3.0)
    world = World(integrator="implicit_euler", floor=0.0, record=STEPS)
    turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    side = list(range(cells[1] + 1))  # the vertices at the lowest x
    threads = SpringMaterial(stiffness, damping=0.05)
    body = world.add_body(mesh, threads, law="springs", pinned=side, position=(0.83, 0, 1.6), rotation=turn)
    world.build()
    world.set_wind((5, 1.5, 0))
    pole = world.add_frame((0, 0, 0))
    wind = {"kind": "wind", "min": -12, "max": 12, "step": 0.5, "unit": "m/s"}
    mast = trimesh.creation.cylinder(radius=0.03, height=2.35, sections=24)
    return Scene(
        world,
        Camera.framing((-0.8, -0.7, 0.0), (1.8, 0.7, 2.4), aspect=1.6, azimuth=-65, elevation=8),
        [
            {**wind, "label": "Wind along", "along": [1, 0, 0], "value": 5},
            {**wind, "label": "Wind across", "along": [0, 1, 0], "value": 1.5},
            _gravity(),
        ],
        [HONEY],
        {pole: "pole", body: "flag"},
        props={pole: (np.add(mast.vertices, (-0.02, 0, 1.175)), mast.faces)},
    )


def tower() -> Scene:
    """Bring a tower down.

    Push the ball through the tower with its slider, blast it, or pull out a block.
    """
    world = World(friction=0.6, record=STEPS)
    contact = Contact(friction=0.6, thickness=0.015)
    material = Material(young=6e4, poisson=0.35, density=300.0, damping_ratio=0.2)
    block = SoftBodyAsset(box((0.7, 0.7, 0.4), (4, 4, 2)), material, contact=contact)
    middle = -np.mean(block.mesh.bounds, axis=0)
    for i in range(6):
        world.add_body(block, position=np.add(middle, (0, 0, 0.21 + i * 0.416)))
    ball = world.add_collider(SphereShape(0.4), position=(-2.0, 0, 1.7), friction=0.4)
    world.build()
    swing = {
        "kind": "move",
        "collider": "ball",
        "min": -2,
        "max": 4,
        "step": 0.05,
        "value": -2,
        "unit": "m",
        "rate": 5,
    }
    blast = {"kind": "blast", "label": "Blast", "at": [0.2, -0.3, 0.1], "impulse": 350, "radius": 2.5}
    return Scene(
        world,
        Camera.framing((-2.4, -1.0, 0.0), (2.2, 1.0, 2.8), aspect=1.6, azimuth=-72, elevation=10),
        [{**swing, "label": "Ball", "along": [1, 0, 0]}, blast, _gravity()],
        [PALETTE[i] for i in (3, 1, 4, 2, 0, 5)],
        {ball: "ball"},
    )


def stiffness() -> Scene:
    """Compare stiffness.

    The Young's moduli of the four balls are 20, 50, 100 and 400 kPa, from left to right.
    """
    world = World(friction=0.6, record=STEPS)
    for i, young in enumerate((2e4, 5e4, 1e5, 4e5)):
        material = Material(young=young, poisson=0.4, density=500.0, damping_ratio=0.03)
        ball = SoftBodyAsset(sphere(0.4, 4), material, contact=Contact(friction=0.5, thickness=0.01))
        world.add_body(ball, position=(1.05 * (i - 1.5), 0, 1.4))
    world.build()
    throw = {"kind": "throw", "label": "Throw them up", "velocity": [0, 0, 5]}
    return Scene(
        world,
        Camera.framing((-2.1, -0.5, 0.0), (2.1, 0.5, 2.3), aspect=1.6, azimuth=-80, elevation=9),
        [throw, _gravity(), _damping()],
        [CORAL, HONEY, LEAF, SKY],
    )


def hand() -> Scene:
    """Swing and twist.

    Move or turn the plate from which the bar hangs, or pull the bar.
    """
    size = (0.26, 0.26, 1.6)
    mesh = box(size, (3, 3, 16))
    mesh = mesh.translated(-np.mean(mesh.bounds, axis=0))
    world = World(friction=0.6, record=STEPS)
    body = world.add_body(
        mesh, Material(young=6e4, poisson=0.35, density=500.0, damping_ratio=0.05), position=(0, 0, 1.5)
    )
    world.build()
    plate = world.add_frame((0, 0, 2.3))
    body.attach(np.flatnonzero(mesh.vertices[:, 2] > 0.79), plate)
    slab = box((0.5, 0.5, 0.08), (1, 1, 1))
    move = {"kind": "move", "frame": "plate", "value": 0}
    return Scene(
        world,
        Camera.framing((-1.3, -0.6, 0.0), (1.3, 0.6, 2.5), aspect=1.6, azimuth=-75, elevation=8),
        [
            {
                **move,
                "label": "Move",
                "along": [1, 0, 0],
                "min": -1,
                "max": 1,
                "step": 0.05,
                "unit": "m",
                "rate": 3,
            },
            {
                **move,
                "label": "Turn",
                "about": [0, 0, 1],
                "min": -360,
                "max": 360,
                "step": 5,
                "unit": "°",
                "rate": 360,
            },
            _gravity(),
            _damping(),
        ],
        [TEAL],
        {plate: "plate", body: "bar"},
        props={plate: (slab.vertices - np.mean(slab.bounds, axis=0) + (0, 0, 0.04), slab.surface)},
    )
