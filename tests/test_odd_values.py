"""Every argument of the public face with every odd value: taken, or refused in one line, nothing changed."""

import warnings

import numpy as np
import pytest

import taichi_soft as ts
from engine_adapter import EngineAdapter, FixedStep
from taichi_soft.render import (
    Camera,
    Renderer,
    Surface,
    Texture,
    VideoWriter,
    colormap,
    draw_labels,
    draw_text,
    highlight,
)
from taichi_soft.render.camera_moves import Follow, Orbit
from taichi_soft.render.film import Actor, Stage, film
from taichi_soft.render.framing import framed
from taichi_soft.world.bare import bare_world

ODD = (
    *(None, True, 0, -0.0, -1, 1.5, np.nan, np.inf, 10**400, 1j, np.float32(2), np.int64(3)),
    *("x", "", b"x", [], [1, 2], [[1], [1, 2]], {}, {1}, (1, 2, 3, 4), object(), len),
    *(np.datetime64("2020"), np.zeros(0), np.array(3.0), np.zeros((3, 3)), np.full((8, 3), np.nan)),
)

MESH = ts.box(cells=(1, 1, 1))
JELLY = ts.Material(1e5, 0.2, 1000.0)
ASSET = ts.SoftBodyAsset(MESH, JELLY)
POINTS = MESH.vertices
ZEROS = np.zeros((8, 3))
CORNER = [[0, 0], [1, 0], [0, 1]]
CAMERA = Camera.framing((-1, -1, 0), (1, 1, 2))
PICTURE = np.zeros((64, 64, 3), np.uint8)


def keywords(call, *names):
    return {f"{call.__name__} {name}": lambda v, _, n=name: call(**{n: v}) for name in names}


def add_body(**options):
    bare_world(floor=None).add_body(MESH, JELLY, **options)


def asset(**options):
    ts.SoftBodyAsset(MESH, JELLY, **options)


def spawn(**options):
    world = bare_world(floor=None)
    world.reserve(ASSET, 1)
    world.spawn(ASSET, **options)


def material(**constants):
    ts.Material(**{"young": 1e5, "poisson": 0.2, "density": 1e3, "damping": 0.0, **constants})


def shell_material(**constants):
    ts.ShellMaterial(**{"young": 1e5, "poisson": 0.2, "density": 1e3, "thickness": 1e-3, **constants})


def rod_material(**constants):
    ts.RodMaterial(**{"young": 1e5, "poisson": 0.2, "density": 1e3, "radius": 1e-2, **constants})


def forces(**options):
    ts.internal_forces(MESH, JELLY, POINTS, **options)


def framing(**options):
    Camera.framing((0, 0, 0), (1, 1, 1), **options)


def renderer(**options):
    Renderer(64, 64, **{"camera": CAMERA, **options})


CALLS = {
    **keywords(ts.World, "gravity", "floor", "restitution", "friction", "integrator", "schedule"),
    **keywords(add_body, "law", "strain", "flips", "damping_model", "position", "rotation", "velocity"),
    **keywords(asset, "law", "strain", "flips", "damping_model", "pinned"),
    "asset mesh": lambda v, _: ts.SoftBodyAsset(v, JELLY),
    "asset material": lambda v, _: ts.SoftBodyAsset(MESH, v),
    **keywords(spawn, "position", "rotation", "velocity", "angular_velocity"),
    "spawn asset": lambda v, game: game.world.spawn(v),
    "despawn": lambda v, game: game.world.despawn(v),
    "reserve asset": lambda v, _: bare_world().reserve(v, 1),
    "reserve count": lambda v, _: bare_world().reserve(ASSET, v),
    "add_body mesh": lambda v, _: bare_world(floor=None).add_body(v, JELLY),
    "add_body material": lambda v, _: bare_world(floor=None).add_body(MESH, v),
    **keywords(material, "young", "poisson", "density", "damping"),
    "per_tet": lambda v, _: JELLY.per_tet("young", v),
    "preset": lambda v, _: ts.preset(v),
    "TetMesh vertices": lambda v, _: ts.TetMesh(v, [[0, 1, 2, 3]]),
    "TetMesh tets": lambda v, _: ts.TetMesh(POINTS, v),
    "ParticleMesh vertices": lambda v, _: ts.ParticleMesh(v, [[0, 1]], 1.0),
    "ParticleMesh edges": lambda v, _: ts.ParticleMesh(POINTS, v, 1.0),
    "ParticleMesh masses": lambda v, _: ts.ParticleMesh(POINTS, [[0, 1]], v),
    "ShellMesh vertices": lambda v, _: ts.ShellMesh(v, [[0, 1, 2]]),
    "ShellMesh triangles": lambda v, _: ts.ShellMesh(CORNER, v),
    "ShellMesh.from_surface": lambda v, _: ts.ShellMesh.from_surface(v),
    "RodMesh vertices": lambda v, _: ts.RodMesh(v),
    "RodMesh closed": lambda v, _: ts.RodMesh(POINTS, closed=v),
    "rod length": lambda v, _: ts.rod(v, 2),
    "rod segments": lambda v, _: ts.rod(1.0, v),
    "sheet size": lambda v, _: ts.sheet(v, (2, 2)),
    "sheet cells": lambda v, _: ts.sheet((1, 1), v),
    **keywords(
        rod_material,
        "young",
        "poisson",
        "density",
        "radius",
        "inner_radius",
        "damping",
        "bending_damping",
        "torsion_damping",
    ),
    **keywords(shell_material, "young", "poisson", "density", "thickness", "damping", "bending_damping"),
    "scaled": lambda v, _: MESH.scaled(v),
    "translated": lambda v, _: MESH.translated(v),
    "rotated": lambda v, _: MESH.rotated(v),
    **keywords(ts.box, "size", "cells"),
    **keywords(ts.sphere, "radius", "resolution"),
    **keywords(ts.cylinder, "radius", "rings", "layers"),
    **keywords(ts.torus, "minor_radius", "segments"),
    **keywords(ts.beam, "length", "cells_across"),
    "voxels mask": lambda v, _: ts.voxels(v),
    "voxels spacing": lambda v, _: ts.voxels(np.ones((1, 1, 1), bool), v),
    "extrude points": lambda v, _: ts.extrude(v, [[0, 1, 2]]),
    "extrude triangles": lambda v, _: ts.extrude(CORNER, v),
    "PlaneShape": lambda v, _: ts.PlaneShape(v),
    "PlaneShape surface": lambda v, _: ts.PlaneShape().surface(v),
    "SphereShape": lambda v, _: ts.SphereShape(v),
    "BoxShape": lambda v, _: ts.BoxShape(v),
    "CapsuleShape radius": lambda v, _: ts.CapsuleShape(v, 1.0),
    "CapsuleShape length": lambda v, _: ts.CapsuleShape(1.0, v),
    "HeightFieldShape heights": lambda v, _: ts.HeightFieldShape(v, 1.0),
    "HeightFieldShape spacing": lambda v, _: ts.HeightFieldShape(np.eye(3), v),
    "MeshShape": lambda v, _: ts.MeshShape(v, cache=False),
    "MeshShape vertices": lambda v, _: ts.MeshShape((v, MESH.surface), cache=False),
    "MeshShape triangles": lambda v, _: ts.MeshShape((POINTS, v), cache=False),
    "MeshShape cell": lambda v, _: ts.MeshShape(MESH, cell=v, cache=False),
    "load_mesh": lambda v, _: ts.load_mesh(v),
    "save_mesh": lambda v, _: ts.save_mesh(MESH, v),
    "save_mesh mesh": lambda v, _: ts.save_mesh(v, "x.npz"),
    "surface_mesh": lambda v, _: ts.surface_mesh(v),
    "surface_mesh positions": lambda v, _: ts.surface_mesh(MESH, v),
    "internal_forces mesh": lambda v, _: ts.internal_forces(v, JELLY, POINTS),
    "internal_forces material": lambda v, _: ts.internal_forces(MESH, v, POINTS),
    "internal_forces positions": lambda v, _: ts.internal_forces(MESH, JELLY, v),
    "internal_forces velocities": lambda v, _: ts.internal_forces(MESH, JELLY, POINTS, v),
    **keywords(forces, "law", "strain", "flips", "damping_model", "dtype"),
    "element_model": lambda v, _: ts.element_model(v),
    "stable_step mesh": lambda v, _: ts.stable_step(v, JELLY, ts.element_model("virial")),
    "stable_step material": lambda v, _: ts.stable_step(MESH, v, ts.element_model("virial")),
    "stable_step model": lambda v, _: ts.stable_step(MESH, JELLY, v),
    "stable_step body": lambda v, game: game.world.stable_step(v),
    "stable_substeps": lambda v, game: game.world.stable_substeps(v),
    "read_positions body": lambda v, game: game.world.read_positions(v, 1.0),
    "read_positions alpha": lambda v, game: game.world.read_positions(game.world.bodies[0], v),
    "render_mesh crease": lambda v, game: game.world.bodies[0].render_mesh(crease=v),
    "read_render_mesh mesh": lambda v, game: game.world.read_render_mesh(v, 1.0),
    "read_render_mesh alpha": lambda v, game: game.world.read_render_mesh(
        game.world.bodies[0].render_mesh(), v
    ),
    "read_render_mesh positions": lambda v, game: game.world.read_render_mesh(
        game.world.bodies[0].render_mesh(), 1.0, v
    ),
    "adapter mesh": lambda v, game: game.render_mesh(v),
    "raycast origin": lambda v, game: game.world.raycast(v, (0, 0, 1)),
    "raycast direction": lambda v, game: game.world.raycast((0, 0, 0), v),
    "raycast max_distance": lambda v, game: game.world.raycast((0, 0, 0), (0, 0, 1), max_distance=v),
    "raycast bodies": lambda v, game: game.world.raycast((0, 0, 0), (0, 0, 1), bodies=v),
    "raycast cull_back": lambda v, game: game.world.raycast((0, 0, 0), (0, 0, 1), cull_back=v),
    "raycast colliders": lambda v, game: game.world.raycast((0, 0, 0), (0, 0, 1), colliders=v),
    "raycast mask": lambda v, game: game.world.raycast((0, 0, 0), (0, 0, 1), mask=v),
    "shapecast position": lambda v, game: game.world.shapecast(ts.SphereShape(1.0), v, (0, 0, 1)),
    "raycasts origins": lambda v, game: game.world.raycasts(v, POINTS + 3),
    "raycasts directions": lambda v, game: game.world.raycasts(POINTS, v),
    "closest_point": lambda v, game: game.world.closest_point(v),
    "closest_point max_distance": lambda v, game: game.world.closest_point((0, 0, 0), max_distance=v),
    "closest_point bodies": lambda v, game: game.world.closest_point((0, 0, 0), bodies=v),
    "overlap_sphere center": lambda v, game: game.world.overlap_sphere(v, 1.0),
    "overlap_sphere radius": lambda v, game: game.world.overlap_sphere((0, 0, 0), v),
    "overlap_box center": lambda v, game: game.world.overlap_box(v, (1, 1, 1)),
    "overlap_box size": lambda v, game: game.world.overlap_box((0, 0, 0), v),
    "overlap_box rotation": lambda v, game: game.world.overlap_box((0, 0, 0), (1, 1, 1), v),
    "record_events": lambda v, game: game.world.record_events(v),
    "on kind": lambda v, game: game.world.on(v, print),
    "on function": lambda v, game: game.world.on(ts.Froze, v),
    "watch_stress": lambda v, game: game.world.bodies[0].watch_stress(v),
    "watch_tearing": lambda v, game: game.world.bodies[0].watch_tearing(v),
    "adapter body": lambda v, game: game.positions(v),
    "adapter world": lambda v, _: EngineAdapter(v),
    "adapter step": lambda v, game: EngineAdapter(game.world, v),
    **keywords(FixedStep, "dt", "substeps", "max_steps"),
    "init arch": lambda v, _: ts.init(v),
    "init threads": lambda v, _: ts.init("cpu", v),
    "init cores": lambda v, _: ts.init("cpu", cores=v),
    **keywords(framing, "aspect", "azimuth", "elevation"),
    "framing lower": lambda v, _: Camera.framing(v, (1, 1, 1)),
    "seeing": lambda v, _: CAMERA.seeing((0, 0, 0), v),
    "seeing margin": lambda v, _: CAMERA.seeing((0, 0, 0), (1, 1, 1), margin=v),
    "Orbit": lambda v, _: Orbit(v),
    "Orbit period": lambda v, _: Orbit(CAMERA, v),
    "Follow": lambda v, _: Follow(v, CAMERA),
    "Follow view": lambda v, game: Follow(game.world.bodies[0], v),
    "Follow lag": lambda v, game: Follow(game.world.bodies[0], CAMERA, lag=v),
    "project": lambda v, _: CAMERA.project(v, 100, 100),
    "project width": lambda v, _: CAMERA.project([[0, 0, 0]], v, 100),
    "Surface positions": lambda v, _: Surface(v, MESH.surface),
    "Surface triangles": lambda v, _: Surface(POINTS, v),
    "Surface color": lambda v, _: Surface(POINTS, MESH.surface, color=v),
    "Surface texture": lambda v, _: Surface(POINTS, MESH.surface, texture=v, uv=POINTS[:, :2]),
    "Surface uv": lambda v, _: Surface(POINTS, MESH.surface, texture=Texture(PICTURE), uv=v),
    "Surface look": lambda v, _: Surface(POINTS, MESH.surface, look=v),
    "set normals": lambda v, _: setattr(Surface.of(MESH), "normals", v),
    "Texture": lambda v, _: Texture(v),
    "Surface.of": lambda v, _: Surface.of(v),
    "set positions": lambda v, _: setattr(Surface.of(MESH), "positions", v),
    "set color": lambda v, _: setattr(Surface.of(MESH), "color", v),
    **keywords(renderer, "camera", "floor"),
    "Renderer width": lambda v, _: Renderer(v, 64, camera=CAMERA),
    "colormap": lambda v, _: colormap(v, 0.0, 1.0),
    "colormap low": lambda v, _: colormap([1.0], v, 1.0),
    "highlight": lambda v, _: highlight(v, (1, 0, 0)),
    "draw_text picture": lambda v, _: draw_text(v, ["a"]),
    "draw_text lines": lambda v, _: draw_text(PICTURE, v),
    "draw_labels places": lambda v, _: draw_labels(PICTURE, ["a"], v),
    "VideoWriter path": lambda v, _: VideoWriter(v, fps=10, size=(64, 64)),
    "VideoWriter fps": lambda v, _: VideoWriter("x.png", fps=v, size=(64, 64)),
    "VideoWriter size": lambda v, _: VideoWriter("x.png", fps=10, size=v),
    "VideoWriter.write": lambda v, _: VideoWriter("x.png", fps=10, size=(64, 64)).write(v),
}

MOVES = {
    "step dt": lambda v, game: game.world.step(v),
    "step substeps": lambda v, game: game.world.step(0.001, v),
    "advance": lambda v, game: game.advance(v),
    "set_motion": lambda v, game: game.world.bodies[0].set_motion(v, ZEROS),
    "set_motion velocities": lambda v, game: game.world.bodies[0].set_motion(POINTS, v),
    "film fps": lambda v, game: film(stage_of(game), None, fps=v, seconds=0.05),
    "film seconds": lambda v, game: film(stage_of(game), None, seconds=v),
    "film slow": lambda v, game: film(stage_of(game), None, slow=v, seconds=0.05),
    "film blur": lambda v, game: film(stage_of(game), None, blur=v, seconds=0.05),
    "framed seconds": lambda v, game: framed(lambda: stage_of(game), seconds=v),
    "framed aspect": lambda v, game: framed(lambda: stage_of(game), aspect=v, seconds=0.05),
    "film size": lambda v, game: film(stage_of(game), "x.png", size=v, seconds=0.05),
}


def stage_of(game):
    return Stage("odd", game.world, [Actor(game.world.bodies[0])], CAMERA, FixedStep(), 1.0)


@pytest.fixture(scope="module")
def game():
    world = bare_world()
    world.add_body(MESH, JELLY, position=(0, 0, 1))
    world.build()
    return EngineAdapter(world)


def refusal(call, value, game):
    """The error of ours that a call ends in, or None; any other error is a failure that names the value."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            call(value, game)
        except ts.TaichiSoftError as error:
            return error
        except Exception as error:
            pytest.fail(f"{value!r}: {type(error).__name__}: {error}")
    return None


def seen(game):
    body = game.world.bodies[0]
    return (
        game.world.time,
        game.world.step_count,
        body.positions().tobytes(),
        body.velocities().tobytes(),
        body.is_frozen,
    )


@pytest.mark.parametrize("name", CALLS)
def test_odd_values_are_taken_or_refused_and_move_nothing(game, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = seen(game)
    refusals = [refusal(CALLS[name], value, game) for value in ODD]
    assert any(refusals)
    assert all(len(str(error)) > 0 and "\n" not in str(error) for error in refusals if error)
    assert seen(game) == before


@pytest.mark.parametrize("name", MOVES)
def test_a_refused_move_moves_nothing(game, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for value in ODD:
        before = seen(game)
        if refusal(MOVES[name], value, game):
            assert seen(game) == before
    assert not game.world.bodies[0].is_frozen
