"""Make the playable gallery: the player, and the world and the recording of each scene.

`python docs/make_worlds.py` makes all scenes, which takes minutes. With names, it makes only these scenes.
After an export, a process cannot use Taichi any more, so each scene is made in a separate process.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from gallery_hooks import WORLDS, scenes

from taichi_soft import init
from taichi_soft.cli.console import say
from taichi_soft.core.errors import MissingExtraError
from taichi_soft.core.extras import require_extra
from taichi_soft.core.handles import handles_of, serial_of
from taichi_soft.live.three_js import FOLDER as THREE
from taichi_soft.live.three_js import fetch_three_js
from taichi_soft.meshing.creases import split_at_creases
from taichi_soft.persistence.snapshot import bodies_hash
from taichi_soft.persistence.world_structure import asset_digest
from taichi_soft.render.props import SLATE, drawn_surface, is_drawn
from taichi_soft.world.world import context_of_world

HERE = Path(__file__).parent
PACKAGE = HERE.parent / "engine_adapter" / "web"
PAGE = ("index.html", "player.css", "player.js", "game.js", "stage.js")
DT = 1 / 60
CREASE = 40.0


def write_player(folder: Path) -> None:
    """Write the player's page and the list of its scenes. Raises: OSError if three.js cannot be fetched."""
    fetch_three_js()
    folder.mkdir(parents=True, exist_ok=True)
    own = [HERE / "play" / name for name in PAGE]
    libraries = [PACKAGE / "taichi-soft.js", PACKAGE / "three.js"]
    drawing = [THREE / name for name in ("three.core.js", "three.module.js", "OrbitControls.js", "LICENSE")]
    for file in (*own, *libraries, *drawing):
        shutil.copyfile(file, folder / {"LICENSE": "three-licence.txt"}.get(file.name, file.name))
    listed = [asdict(each) for each in scenes() if (folder / each.name / "scene.json").is_file()]
    (folder / "scenes.json").write_text(json.dumps(listed), encoding="utf-8")


def write_scene(name: str, folder: Path) -> None:
    """Write a scene: its world, its recording, and the data for the page.

    After the export, this process cannot use Taichi any more.
    """
    from play import scenes as made

    from taichi_soft.export import export_world

    init("cpu")
    scene = vars(made)[name]()
    world, context = scene.world, context_of_world(scene.world)
    first, handles = world.snapshot(), _handles(world)
    for _ in range(made.STEPS):
        world.step(DT)
    proof = {"steps": made.STEPS, "hash": bodies_hash(context)}
    folder.mkdir(parents=True, exist_ok=True)
    world.save_recording(folder / f"{name}.recording")
    world.restore(first)
    frames = list(scene.props)
    facts = {
        "dt": DT,
        "camera": {"eye": scene.camera.eye, "target": scene.camera.target, "fov": scene.camera.fov_degrees},
        "colors": scene.colors,
        "textures": {scene.names[asset]: _picture(folder, each) for asset, each in scene.textures.items()},
        "colliders": [
            {"number": i, "color": SLATE, **_drawn(drawn_surface(each.shape))}
            for i, each in enumerate(context.colliders.all_handles)
            if is_drawn(each)
        ],
        "props": [
            {"frame": scene.names[each], "color": SLATE, **_drawn(scene.props[each])} for each in frames
        ],
        "controls": scene.controls,
        "handles": handles,
        "parts": {
            scene.names[each]: asset_digest(each) for each in context.slots.kinds if each in scene.names
        },
        "proof": proof,
    }
    report = export_world(world, folder / "world", names=scene.names, platforms=["web"])
    (folder / "scene.json").write_text(json.dumps(facts), encoding="utf-8")
    say(f"{name}: {report.size / 1e6:.1f} MB, step {made.STEPS} has the hash {proof['hash']}")


def _handles(world: Any) -> dict[str, Any]:
    """Return the serial numbers by which a recording names objects.

    Returns: numbers of bodies (by slot), colliders and frames, with 0 for an empty slot; and the next free
        number.
    """
    from taichi_soft.control.frames import Frames

    context = context_of_world(world)

    def serials(handles: Any) -> list[int]:
        return [0 if each is None else serial_of(each) for each in handles]

    return {
        "body": serials(context.slots.slots),
        "collider": serials(context.colliders.all_handles),
        "frame": serials(context.of(Frames).rows),
        "next": handles_of(world).count,
    }


def _drawn(surface: Any) -> dict[str, list[float]]:
    vertices = np.asarray(surface[0], dtype=np.float64)
    corners, triangles = split_at_creases(vertices, np.asarray(surface[1]), CREASE)
    return {
        "vertices": np.round(vertices[corners], 4).ravel().tolist(),
        "triangles": np.ravel(triangles).tolist(),
    }


def _picture(folder: Path, picture: Any) -> str:
    picture.save(folder / "texture.jpg", quality=88)
    return "texture.jpg"


def main() -> None:
    """Make the scenes that are named, or all scenes, and the page for all scenes that exist."""
    options = argparse.ArgumentParser(description="Make the worlds of the playable gallery.")
    options.add_argument("names", nargs="*", metavar="NAME", help="a scene; all of them by default")
    options.add_argument("--out", type=Path, default=WORLDS, help="folder of the page")
    options.add_argument("--alone", action="store_true", help="make this one scene in this process")
    given = options.parse_args()
    if given.alone:
        write_scene(given.names[0], given.out / given.names[0])
        return
    try:
        require_extra("export", "a playable gallery needs")
        for name in given.names or [each.name for each in scenes()]:
            command = [sys.executable, __file__, name, "--alone", "--out", str(given.out)]
            subprocess.run(command, check=True)
        write_player(given.out)
    except (MissingExtraError, OSError) as error:  # OSError: three.js could not be fetched
        say(f"playable worlds: skipped. {error}")


if __name__ == "__main__":
    main()
