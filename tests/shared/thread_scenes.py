"""Scenes with many bodies, whose results are compared bit by bit.

As a program, run all scenes with a number of threads, and write the results to a file:

    python tests/shared/thread_scenes.py 2 out.json

The scene with the most bodies runs first, so that the other scenes reuse its kernels.
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import trimesh

ROOT = Path(__file__).parents[2]
if __name__ == "__main__":
    sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

# ruff: noqa: E402
import random_play

from taichi_soft import Contact, Material, SoftBodyAsset, SpringMaterial, box, cloth, init, sphere
from taichi_soft.bodies.render_mesh import MIN_PARALLEL_VERTICES
from taichi_soft.world.bare import bare_world

CUBE = box(cells=(2, 2, 2))
TOP = np.flatnonzero(CUBE.vertices[:, 2] > 0.49)
JELLY = Material(1e5, 0.2, 1000.0, 20.0)
DT = 1 / 60


def motion(world):
    """Return hashes of the positions and velocities of every body, after a check that the bodies move."""
    rows = [each for body in world.bodies for each in (body.positions(), body.velocities())]
    assert all(np.isfinite(each).all() and each.any() for each in rows)
    return [hashlib.sha256(each.tobytes()).hexdigest() for each in rows]


def thrown(recorded=True):
    """Throw twelve bodies at each other. Return the world, the bodies' momentum gains, and the events."""
    world = bare_world(gravity=(0, 0, 0), floor=None, soft_contact=True)
    rng = np.random.default_rng(3)
    mesh, material = sphere(0.3, 2), Material(1e5, 0.2, 1000.0, 2.0)
    ways = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 0, 1)]) * 0.7
    for way in ways:
        world.add_body(mesh, material, position=way + rng.normal(scale=0.02, size=3), velocity=-4 * way)
    world.build()
    if recorded:
        world.record_events()
        for body in world.bodies:
            body.watch_stress(1e4)
    before = np.array([body.momentum() for body in world.bodies])
    events = []
    for _ in range(60):
        world.step(DT, 4)
        if recorded:
            events += world.drain_events()
    return world, np.array([body.momentum() for body in world.bodies]) - before, events


def written(event):
    kind = type(event).__name__
    if kind.startswith("Contact"):
        return [event.step, kind, event.a.index, event.b.index, event.impulse.tobytes().hex()]
    return [event.step, kind, event.body.index, event.tetrahedra.tolist(), event.stress.tobytes().hex()]


def crowd():
    world, _, events = thrown()
    assert len(events) > 30
    return [*motion(world), *map(written, events)]


def heap():
    """Drop six bodies onto each other. One of them also touches itself."""
    world = bare_world(soft_contact=True)
    for i in range(6):
        mesh = sphere(0.3, 2) if i % 2 else box((0.5, 0.5, 0.5), (2, 2, 2))
        place = (0.1 * i + 3.0 * (i > 3), 0.05 * i, 0.4 + 0.6 * (i % 4))
        contact = Contact(itself=i == 0)
        world.add_body(mesh, Material(2e5, 0.3, 1000.0, 40.0), position=place, contact=contact)
    world.build()
    for _ in range(60):
        world.step(DT)
    return motion(world)


def inside():
    """Place six bodies inside each other; the world moves them apart."""
    world = bare_world(soft_contact=True)
    for i in range(6):
        place = (0.04 * i, 0.02 * i * i, 0.26 + 0.1 * (i % 2))
        world.add_body(box((0.5,) * 3, (2, 2, 2)), Material(2e5, 0.3, 1000.0, 40.0), position=place)
    world.build()
    for _ in range(60):
        world.step(DT)
    return motion(world)


def joined(options):
    """Pull aside one of two stacks of three joined bodies. Also return the force of the last joint."""
    world = bare_world(**options)
    for i in range(6):
        world.add_body(CUBE, JELLY, position=(3 * (i // 3), 0, 0.6 + i % 3))
    world.build()
    world.step(DT, 6)
    joints = [world.bodies[i].attach_to(world.bodies[i + 1], TOP) for i in (3, 0, 1, 4)]
    for step in range(40):
        world.bodies[1].apply_force((2e4, 0, 1e4))
        if step == 20:
            joints[0].release()
        world.step(DT, 6)
    assert np.abs(joints[2].force).max() > 100
    return [*motion(world), joints[2].force.tobytes().hex()]


def fallen(schedule):
    """Drop three bodies onto the floor."""
    world = bare_world(schedule=schedule)
    for i in range(3):
        mesh = sphere(0.5, 3) if i else CUBE
        world.add_body(mesh, JELLY, position=(2 * i, 0, 0.51 + 0.02 * i))
    world.build()
    for _ in range(25 if schedule == "per_body" else 8):
        world.step(DT, 6)
    return motion(world)


def torn():
    """Deform bodies so strongly that steps fail and are retried, and tetrahedra invert."""
    world = bare_world()
    for i in range(3):
        mesh = CUBE if i % 2 else sphere(0.5, 3)
        world.add_body(mesh, Material(3e5, 0.3, 500.0), position=(2 * i, 0, 1.0))
    world.build()
    for body in world.bodies:
        x = body.positions()
        body.set_motion(x, 60.0 * np.random.default_rng(0).normal(size=x.shape))
    for _ in range(40):
        world.step(DT)
    return motion(world)


def drawn():
    """Return vertices and normals of a large surface that several threads compute."""
    mesh = cloth((1, 1), (50, 50), 0.1)
    world = bare_world(gravity=(0, 0, 0), floor=None)
    body = world.add_body(mesh, SpringMaterial(100.0, 0.1))
    world.build()
    shift = np.random.default_rng(2).normal(scale=0.1, size=mesh.vertices.shape)
    body.set_motion(mesh.vertices + shift, 0.0 * shift)
    skin = body.render_mesh()
    assert skin.vertex_count > MIN_PARALLEL_VERTICES
    return [rows.tobytes().hex() for rows in world.read_render_mesh(skin, 0.3)]


def played():
    """Return the hashes of 300 ticks of a random game. Wrong inputs are undone every 20 ticks."""
    hashes, different = random_play.check(300, seed=11)
    assert different == 0
    assert len(set(hashes)) == 300
    return hashes


def hulled():
    """Throw balls with hulls into a corner, next to a box without a hull."""
    world = bare_world(soft_contact=True, collider_room=1)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    asset = SoftBodyAsset.from_surface(ball, JELLY, cells=5, hull=200)
    for i in range(4):
        world.add_body(asset, position=(0.5 * (i % 2), 0.1 * i, 0.35 + 0.55 * i), velocity=(1, 1, 0))
    world.add_body(box((0.5, 0.5, 0.5), (2, 2, 2)), JELLY, position=(1.0, 0.3, 0.3))
    world.build()
    for _ in range(40):
        world.step(DT)
    return motion(world)


SCENES = {
    "crowd": crowd,
    "heap": heap,
    "inside": inside,
    "joined, touching": lambda: joined({"soft_contact": True}),
    "joined, passing": lambda: joined({"collider_room": 1}),
    "fallen, per body": lambda: fallen("per_body"),
    "fallen, flat": lambda: fallen("flat"),
    "hulled": hulled,
    "torn": torn,
    "drawn": drawn,
    "played": played,
}

if __name__ == "__main__":
    init("cpu", threads=int(sys.argv[1]))
    found = {name: scene() for name, scene in SCENES.items()}
    Path(sys.argv[2]).write_text(json.dumps(found))
