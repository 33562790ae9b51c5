"""What a live world is made from, as a script: that which is saved is that which ran."""

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

world = World(soft_contact=True, collider_room=2)
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
    """What a live world is made from.

    Args:
        kind: "playground", bodies on a floor; a "demo" by its `name`; or a "script" by its path.
        law, strain, flips: of all bodies, None as the scene has them.
        meshes: paths of surfaces that visitors brought.
    """

    kind: Literal["playground", "demo", "script"] = "playground"
    name: str = ""
    law: str | None = None
    strain: str | None = None
    flips: str | None = None
    meshes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """What visitors are told."""
        return Path(self.name).stem if self.name else "playground"

    @property
    def folder(self) -> Path:
        """Where its script finds the files that it names."""
        return Path(self.name).resolve().parent if self.kind == "script" else Path.cwd()

    def script(self, *, is_alone: bool = False) -> str:
        """The script that makes `world`.

        Args:
            is_alone: whether the files that it names lie in `files` beside it, as where it was saved.
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
        """A file, as the script names it."""
        return f'Path(__file__).parent / "files" / {Path(path).name!r}' if is_alone else repr(path)


@dataclass
class Scene:
    """A built world, and how it is stepped and seen."""

    title: str
    world: World
    step: FixedStep
    camera: Camera
    act: Callable[[World], object] | None = None  # before every fixed step
    colors: dict[int, Color] = field(default_factory=dict)  # of bodies, by the number of their slot

    def color(self, slot: int) -> Color:
        """Of a body, sRGB from 0 to 1."""
        return self.colors.get(slot, PALETTE[slot % len(PALETTE)])


def made_scene(source: SceneSource) -> Scene:
    """Run its script.

    Raises: whatever the script raises; OptionError for one that makes no world, or several.
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
            raise OptionError(f"{source.name} must make one World, in a variable of its own") from None
        raise
    stage, world = names.get("stage"), names["world"]
    if isinstance(stage, Stage):
        colors = {actor.body.index: actor.color for actor in stage.actors if actor.world in (None, world)}
        return Scene(stage.title, world, stage.step, _camera_at_start(stage), stage.act, colors)
    return Scene(source.title, world, FixedStep(), framing_of(world))


def _camera_at_start(stage: Stage) -> Camera:
    return stage.camera if isinstance(stage.camera, Camera) else framing_of(stage.world)


def framing_of(world: World) -> Camera:
    """All bodies, and the floor below them."""
    rows = np.concatenate([body.positions() for body in world.bodies] or [np.zeros((1, 3), np.float32)])
    low, high = rows.min(axis=0).astype(float), rows.max(axis=0).astype(float)
    if world.settings.floor is not None:
        low[2] = min(low[2], world.settings.floor)
    low[:2] -= 0.5
    high += 0.5
    return Camera.framing(low, high, aspect=16 / 9, azimuth=-62.0, elevation=22.0, fov_degrees=40.0)


def adapter_of(scene: Scene, substeps: int, before: Callable[[World], object]) -> EngineAdapter:
    """For a scene, with so many substeps; `before` is called before each step."""
    # Where a world is slower than real time, it shows slow motion rather than few pictures.
    step = FixedStep(dt=scene.step.dt, substeps=substeps, max_steps=2)
    return EngineAdapter(scene.world, step, before_step=before)


def found_source(text: str | None) -> SceneSource:
    """What a command line names: nothing, a demo, a script, or a mesh.

    Raises: OptionError for what is none of them.
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
        f"{text!r} is no demo, no script and no mesh: name a file, or {choose_one_of(demo_names(), text)}"
    )
