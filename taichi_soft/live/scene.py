"""Sources of live worlds. Every source is run as a script. A saved scene contains this script."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import World
from taichi_soft.core.checks import choose_one_of
from taichi_soft.core.errors import OptionError
from taichi_soft.render import PALETTE, Camera
from taichi_soft.render.colors import Color
from taichi_soft.render.film import Stage

_PLAYGROUND = """\
from taichi_soft import Material, World, box, cylinder, sphere, torus

world = World()
material = Material(young=1.5e5, poisson=0.4, density=500.0, damping_ratio=0.15)
shapes = [sphere(0.3, 3), box((0.5, 0.5, 0.5), (3, 3, 3)), cylinder(0.28, 0.5, 2, 4)]
shapes.append(torus(0.32, 0.13, 1, 18))
for i in range(6):
    place = (0.9 * (i % 3) - 0.9, 0.5 - 1.0 * (i // 3), 0.5 + 0.12 * i)
    world.add_body(shapes[i % len(shapes)], material, position=place)
world.build()
"""

_DEMO = """\
from taichi_soft.render.demos import load_demo

stage = load_demo({name!r}).stage()
world, act = stage.world, stage.act
"""

_SCRIPT = """\
import runpy

made = runpy.run_path(str({name!r}), run_name="taichi_soft_scene")
(world,) = {each for each in made.values() if isinstance(each, World)}
if not world.is_built:
    world.build()
"""


@dataclass(frozen=True)
class SceneSource:
    """Source of a live world.

    Args:
        kind: "playground" for bodies on a floor, "demo" or "script".
        name: name of the demo, or path of the script.
        law, strain, flips: settings of all bodies; None keeps the scene's setting.
        meshes: paths of surfaces that visitors uploaded.
    """

    kind: Literal["playground", "demo", "script"] = "playground"
    name: str = ""
    law: str | None = None
    strain: str | None = None
    flips: str | None = None
    meshes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Title of the scene for visitors."""
        return Path(self.name).stem if self.name else "playground"

    @property
    def folder(self) -> Path:
        """Folder that contains the files named by the script."""
        return Path(self.name).resolve().parent if self.kind == "script" else Path.cwd()

    def script(self, *, is_alone: bool = False) -> str:
        """Return the script that makes `world`.

        Args:
            is_alone: True if the files that the script names are in the folder `files` next to the script.
        """
        files = ", ".join(self._place(each, is_alone) for each in self.meshes)
        options = [
            f"{key}={getattr(self, key)!r}" for key in ("law", "strain", "flips") if getattr(self, key)
        ]
        options += ["has_palette=True", *([f"meshes=[{files}]"] if self.meshes else [])]
        body = {"playground": _PLAYGROUND, "demo": _DEMO, "script": _SCRIPT}[self.kind]
        name = self._place(self.name, is_alone) if self.kind == "script" else repr(self.name)
        lines = body.replace("{name!r}", name).splitlines()
        inner = "\n".join(f"    {line}" if line else "" for line in lines)
        head = "from pathlib import Path\n\n"
        head += "from taichi_soft import World\nfrom taichi_soft.live import choices\n"
        return f"{head}\nwith choices({', '.join(options)}):\n{inner}\n"

    @staticmethod
    def _place(path: str, is_alone: bool) -> str:
        """Return the Python expression for the path of a file in the script."""
        return f'Path(__file__).parent / "files" / {Path(path).name!r}' if is_alone else repr(path)


@dataclass
class Scene:
    """A built world with its step, camera and colours."""

    title: str
    world: World
    step: FixedStep
    camera: Camera
    act: Callable[[World], object] | None = None  # called before every fixed step
    colors: dict[int, Color] = field(default_factory=dict)  # colours of bodies, by slot

    def color(self, slot: int) -> Color:
        """Return the colour of the body in a slot, sRGB from 0 to 1."""
        return self.colors.get(slot, PALETTE[slot % len(PALETTE)])


def made_scene(source: SceneSource) -> Scene:
    """Run a scene's script and return the scene.

    Raises: any error of the script; OptionError if the script makes no world or several worlds.
    """
    path = source.folder / "taichi_soft_live_scene.py"
    names: dict[str, Any] = {"__name__": "taichi_soft_live_scene", "__file__": str(path)}
    if source.kind == "script":
        sys.path[:0] = [str(source.folder)]
        if not Path(source.name).is_file():
            raise OptionError(f"cannot read {source.name}: no such file")
    try:
        exec(compile(source.script(), path.name, "exec"), names)
    except ValueError as error:
        if "values to unpack" in str(error) and source.kind == "script":
            raise OptionError(f"{source.name} must have exactly one global World") from None
        raise
    stage, world = names.get("stage"), names["world"]
    if isinstance(stage, Stage):
        colors = {actor.body.index: actor.color for actor in stage.actors if actor.world in (None, world)}
        return Scene(stage.title, world, stage.step, _camera_at_start(stage), stage.act, colors)
    return Scene(source.title, world, FixedStep(), framing_of(world))


def _camera_at_start(stage: Stage) -> Camera:
    return stage.camera if isinstance(stage.camera, Camera) else framing_of(stage.world)


def framing_of(world: World) -> Camera:
    """Return a camera that sees all bodies and the floor below them."""
    rows = np.concatenate([body.positions() for body in world.bodies] or [np.zeros((1, 3), np.float32)])
    low, high = rows.min(axis=0).astype(float), rows.max(axis=0).astype(float)
    if world.settings.floor is not None:
        low[2] = min(low[2], world.settings.floor)
    low[:2] -= 0.5
    high += 0.5
    return Camera.framing(low, high, aspect=16 / 9, azimuth=-62.0, elevation=22.0, fov_degrees=40.0)


def adapter_of(scene: Scene, substeps: int, before: Callable[[World], object]) -> EngineAdapter:
    """Make the adapter of a scene; `before` is called before each step."""
    # A world slower than real time runs in slow motion rather than at a low frame rate.
    step = FixedStep(dt=scene.step.dt, substeps=substeps, max_steps=2)
    return EngineAdapter(scene.world, step, before_step=before)


def found_source(text: str | None) -> SceneSource:
    """Return the source that an argument of the command line names. None is the playground.

    Raises: OptionError if the text names no demo, script or mesh.
    """
    from taichi_soft.render.demos import demo_names

    if text is None:
        return SceneSource()
    if text in demo_names():
        return SceneSource("demo", text)
    path = Path(text)
    if path.suffix == ".py" and path.is_file():
        return SceneSource("script", str(path))
    if path.is_file():
        return SceneSource(meshes=(str(path.resolve()),))
    raise OptionError(
        f"{text!r} is not a demo, a script or a mesh: name a file, or {choose_one_of(demo_names(), text)}"
    )
