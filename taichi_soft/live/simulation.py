"""The process that steps a world and writes its pictures. It knows no network, and waits for nobody."""

from __future__ import annotations

import time
import traceback
import warnings
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_adapter import EngineAdapter
from taichi_soft import Grab, World
from taichi_soft.core.errors import TaichiSoftError, UnstableStepWarning
from taichi_soft.live.choices import palette_of
from taichi_soft.live.controls import Controls
from taichi_soft.live.drawn import Drawn
from taichi_soft.live.frame_file import FrameFile
from taichi_soft.live.saving import FILM_FPS, film_frames, saved_script
from taichi_soft.live.scene import Scene, SceneSource, adapter_of, made_scene
from taichi_soft.live.tints import Tints

PICTURES = 60.0
"""Pictures a second, at most."""

TOLD = 5.0
"""How often numbers are told in a second."""

SHARE = 0.05
"""Of the time, what looking at stress and at energies may take, each."""

KEPT = 10.0
"""Seconds that a film can be made of."""

MOST_KEPT = 2**28
"""Bytes of pictures: of many vertices a film is shorter."""

STEPS = 600
"""The last ones, whose percentiles are told."""

MOST_HELD = 8
"""Bodies that visitors hold at a time."""


@dataclass
class Motion:
    """Where bodies are, to go on with in another world: by slot, (asset's name or None, x, v)."""

    rows: dict[int, tuple[str | None, NDArray[Any], NDArray[Any]]] = field(default_factory=dict)


def run(connection: Connection, folder: str, source: SceneSource, given: dict[str, float]) -> None:
    """Make a scene and step it until `("stop",)` comes. What goes wrong is told, never raised.

    Messages in are `(name, *arguments)`: those of `Simulation.do_...`. Messages out: ("ready", ...),
    ("drawn", ...), ("frame", number), ("state", ...), ("said", words), ("saved", ...), ("failed", words).
    """
    from taichi_soft import init

    warnings.simplefilter("always")
    try:
        init("cpu")
        simulation = Simulation(connection, Path(folder), made_scene(source), source)
        simulation.start(given)
    except BaseException as error:
        connection.send(("failed", _words_of(error)))
        return
    try:
        simulation.play()
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return
    except BaseException as error:
        traceback.print_exc()
        connection.send(("failed", _words_of(error)))


def _words_of(error: BaseException) -> str:
    text = str(error) or type(error).__name__
    return text if isinstance(error, TaichiSoftError) else f"{type(error).__name__}: {text}"


class Simulation:
    """One world with its visitors' hands in it."""

    def __init__(self, connection: Connection, folder: Path, scene: Scene, source: SceneSource) -> None:
        self.connection, self.folder, self.scene, self.source = connection, folder, scene, source
        self.world = scene.world
        self.controls = Controls(self.world, scene.step.dt, scene.step.substeps)
        self._begun: list[float] = []  # when each of the steps of an advance began
        self.adapter: EngineAdapter = adapter_of(scene, self.controls.substeps, self._before_step)
        self.first = b""  # its state before anything moved
        self.is_playing, self.is_moving = False, True  # until it is shown
        self.hands: dict[int, Grab] = {}
        self.tints: Tints | None = None
        self.step_times: deque[float] = deque(maxlen=STEPS)
        self.recent: deque[tuple[float, int, Any]] = deque()
        self.versions = 0
        self.drawn: Drawn
        self.frames: FrameFile
        self._due = {"picture": 0.0, "told": 0.0, "tints": 0.0, "energies": 0.0, "film": 0.0}
        self._energies: dict[str, float] = {}
        self._simulated = self._since = 0.0
        self._factor = 0.0
        self._steps_seen = 0
        self._pulls: dict[int, tuple[int, int]] = {}  # by visitor: a move that no picture shows, the step
        self._alpha: float | None = None  # of a world that somebody else steps

    def start(self, given: dict[str, float]) -> None:
        """Compile all that a visitor may ask for, and tell what is drawn."""
        self.controls.given.update(given)
        self.controls.give_all()
        self.world.warm_up()
        self._renew_adapter()
        self.first = self.world.snapshot()
        self.describe()
        self.draw(time.perf_counter(), True)
        self.connection.send(("ready", self._told()))

    def look(self, alpha: float) -> None:
        """Do what visitors wish, and show a world that somebody else steps."""
        while self.connection.poll():
            self._obey(self.connection.recv())
        if self.world.step_count != self._steps_seen:
            self._steps_seen, self.is_moving = self.world.step_count, True
        self._alpha = alpha
        self.draw(time.perf_counter(), self.is_moving)
        self._tell(time.perf_counter())

    def play(self) -> None:
        """Until told to stop."""
        last = time.perf_counter()
        while True:
            while self.connection.poll():
                message = self.connection.recv()
                if message[0] == "stop":
                    return
                self._obey(message)
            now = time.perf_counter()
            if self.is_playing:
                self._advance(min(now - last, 0.25) * self.controls.given.get("speed", 1.0))
            last = now
            self.draw(time.perf_counter(), self.is_moving)
            self._tell(time.perf_counter())
            left = last + self.adapter.fixed_step.dt / 2 - time.perf_counter()
            self.connection.poll(max(left, 0.0005) if self.is_playing else 0.02)

    def _obey(self, message: tuple[Any, ...]) -> None:
        """One wish. One that cannot be met is told of, and changes nothing."""
        name, *arguments = message
        try:
            getattr(self, f"do_{name}")(*arguments)
        except Exception as error:
            self.connection.send(("said", _words_of(error)))
        self.is_moving = True

    def _before_step(self, world: World) -> None:
        if self.scene.act is not None:
            self.scene.act(world)
        self._begun.append(time.perf_counter())

    def _advance(self, seconds: float) -> None:
        """Let time go on. A step that fails stops the world, which says why."""
        before = self.world.step_count
        self._begun.clear()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                self.adapter.advance(seconds)
            except Exception as error:
                self.is_playing = False
                self.connection.send(("said", f"stopped: {_words_of(error)}"))
        ends = [*self._begun[1:], time.perf_counter()]
        self.step_times.extend(end - start for start, end in zip(self._begun, ends, strict=False))
        self._simulated += (self.world.step_count - before) * self.adapter.fixed_step.dt
        self.is_moving = True  # also between two steps
        for each in caught:
            # The page predicts by itself what is unstable: of the materials that bodies have, not of those
            # that there is room for.
            if not issubclass(each.category, UnstableStepWarning):
                self.connection.send(("said", str(each.message)))

    # What a visitor may wish for.

    def do_set(self, name: str, value: float) -> None:
        """Give a slider a value."""
        before = self.controls.substeps
        self.controls.set(name, value)
        if self.controls.substeps != before:
            self._renew_adapter()
        self._due["told"] = 0.0

    def do_pause(self, is_paused: bool) -> None:
        """Stop, or go on."""
        self.is_playing = not is_paused
        self._pulls.clear()  # how long it stood is not how late a picture is
        self._due["told"] = 0.0

    def do_step(self) -> None:
        """Make one step of a world that stands."""
        self.is_playing = False
        self._begun.clear()
        self.adapter.step()
        self.step_times.append(time.perf_counter() - self._begun[0])
        self._simulated += self.adapter.fixed_step.dt
        self._due["told"] = 0.0

    def do_reset(self) -> None:
        """Go back to the beginning; what sliders say stays. A scene with code of its own is made anew by the
        server instead: what that code remembers is in no snapshot.
        """
        self.do_release_all()
        self.world.restore(self.first)
        self.controls.give_all()
        self._renew_adapter()

    def do_grab(self, visitor: int, origin: list[float], direction: list[float]) -> None:
        """Take hold of what a ray hits first."""
        self.do_release(visitor)
        if len(self.hands) >= MOST_HELD:
            raise TaichiSoftError(f"{MOST_HELD} bodies are held already: let one go")
        grab = self.world.grab(origin, direction)
        if grab is not None:
            self.hands[visitor] = grab

    def do_move(self, visitor: int, point: list[float], number: int = 0) -> None:
        """Pull what a visitor holds to a point; `number` tells its moves apart."""
        grab = self.hands.get(visitor)
        if grab is not None and grab.is_held:
            grab.move(point)
            if number and self.is_playing:
                self._pulls.setdefault(visitor, (number, self.world.step_count))

    def do_release(self, visitor: int) -> None:
        """Let go of what a visitor holds, with the speed that it has."""
        grab = self.hands.pop(visitor, None)
        if grab is not None and grab.is_held:
            grab.release()

    def do_release_all(self) -> None:
        """Let all go."""
        for visitor in list(self.hands):
            self.do_release(visitor)

    def do_spawn(self, name: str) -> None:
        """Add a body of the palette above the middle of what is seen."""
        palette = palette_of(self.world)
        if name not in palette:
            raise TaichiSoftError(f"there is no {name!r} here: choose one of {', '.join(palette) or 'none'}")
        target = np.array(self.scene.camera.target)
        number = len(self.world.bodies)
        spot = target + 0.35 * np.array([np.cos(2.4 * number), np.sin(2.4 * number), 0.0])
        low = palette[name].mesh.bounds[0]
        height = max(float(target[2]) + 1.0, (self.world.settings.floor or 0.0) + 1.5)
        body = self.world.spawn(palette[name], position=(*spot[:2], height - float(low[2])))
        self.controls.greet(body)

    def do_despawn(self) -> None:
        """Take the body away that came last."""
        added = {id(asset) for asset in palette_of(self.world).values()}
        mine = [body for body in self.world.bodies if id(body.asset) in added]
        if not mine:
            raise TaichiSoftError("nothing was added that could be taken away")
        self.world.despawn(mine[-1])

    def do_tint(self, quantity: str | None) -> None:
        """Colour bodies by a quantity, or by themselves."""
        self.tints = None if quantity is None else Tints(quantity)
        self._due["tints"] = 0.0

    def do_motion(self) -> None:
        """Tell where all bodies are, for a world of another law to go on with."""
        names = {id(asset): name for name, asset in palette_of(self.world).items()}
        rows = {
            body.index: (names.get(id(body.asset)), body.positions(), body.velocities())
            for body in self.world.bodies
        }
        self.connection.send(("motion", Motion(rows)))

    def do_take_motion(self, motion: Motion) -> None:
        """Go on from where the bodies of another world are."""
        palette, bodies = palette_of(self.world), {body.index: body for body in self.world.bodies}
        for slot, (name, positions, velocities) in motion.rows.items():
            body = bodies.pop(slot, None)
            if body is None and name in palette:
                body = self.world.spawn(palette[name], position=(0.0, 0.0, 50.0 + 2.0 * slot))
                self.controls.greet(body)
            if body is not None and body.vertex_count == len(positions):
                body.set_motion(positions, velocities)
        for body in bodies.values():
            self.world.despawn(body)

    def do_save(self, number: int) -> None:
        """Write the script that makes this world, and a snapshot."""
        snapshot = self.world.snapshot()
        step = self.adapter.fixed_step
        text = saved_script(self.source, self.world.state_hash(), step.dt, self.controls.substeps)
        self.connection.send(("saved", number, text, snapshot))

    def do_film(self, number: int) -> None:
        """Write the last seconds as frames to draw."""
        path = self.folder / f"film{number}.npz"
        try:
            film_frames(path, list(self.recent), self.drawn, self.scene)
        except Exception:
            self.connection.send(("filmed", number, ""))
            raise
        self.connection.send(("filmed", number, str(path)))

    # What is told.

    def draw(self, now: float, is_moving: bool) -> None:
        """Write a picture, where it is time for one and something moved."""
        if self.drawn.is_outdated:
            self.describe()
            is_moving = True
        if self.tints is not None and now >= self._due["tints"]:
            self.tints.renew(self.world)
            self._due["tints"] = now + (time.perf_counter() - now) / SHARE
            is_moving = True
        if not is_moving or now < self._due["picture"]:
            return
        frame = self.frames.begin()
        alpha = self.adapter.alpha if self._alpha is None else self._alpha
        self.drawn.fill(frame, alpha, None if self.tints is None else self.tints.rows)
        moment = self.world.time - (1.0 - alpha) * self.world.last_dt
        number = self.frames.publish(self.drawn.version, moment, is_tinted=self.tints is not None)
        steps = self.world.step_count
        pulls = {visitor: move for visitor, (move, step) in self._pulls.items() if step != steps}
        self._pulls = {each: pull for each, pull in self._pulls.items() if each not in pulls}
        self.connection.send(("frame", number, pulls))
        if now >= self._due["film"]:
            if self.recent and moment < self.recent[-1][0]:
                self.recent.clear()  # it went back to its beginning
            self.recent.append((moment, self.drawn.version, (frame.positions.copy(), frame.poses.copy())))
            most = min(KEPT * FILM_FPS, MOST_KEPT / (12 * max(self.drawn.vertex_count, 1)))
            while len(self.recent) > most:
                self.recent.popleft()
            self._due["film"] = now + 1.0 / FILM_FPS - 0.002
        self._due["picture"] = now + 1.0 / PICTURES - 0.001
        self.is_moving = False

    def describe(self) -> None:
        """Tell what is drawn."""
        self.versions += 1
        self.drawn = Drawn(self.scene, self.versions)
        path = self.folder / f"frames{self.versions}"
        self.frames = FrameFile(path, self.drawn.vertex_count, len(self.drawn.colliders), is_new=True)
        self.recent.clear()
        with suppress(OSError):  # one that is still read where files in use cannot be removed
            (self.folder / f"frames{self.versions - 2}").unlink(missing_ok=True)
        if self.tints is not None:
            self.tints.renew(self.world)
        sizes = self.drawn.vertex_count, len(self.drawn.colliders)
        self.connection.send(("drawn", str(path), sizes, *self.drawn.described()))

    def _tell(self, now: float) -> None:
        if now < self._due["told"]:
            return
        if now >= self._due["energies"]:
            self._look_at_energies(now)
        elapsed = now - self._since
        if elapsed >= 0.5:
            self._factor, self._simulated, self._since = self._simulated / elapsed, 0.0, now
        self._due["told"] = now + 1.0 / TOLD
        self.connection.send(("state", self._told()))

    def _look_at_energies(self, start: float) -> None:
        bodies = self.world.bodies
        self._energies = {
            "kinetic": sum(body.kinetic_energy() for body in bodies),
            "elastic": sum(body.elastic_energy() for body in bodies),
            "potential": sum(body.gravitational_energy() for body in bodies),
            "momentum": float(np.linalg.norm(sum((body.momentum() for body in bodies), np.zeros(3)))),
        }
        self._due["energies"] = start + (time.perf_counter() - start) / SHARE

    def _told(self) -> dict[str, Any]:
        times = np.array(self.step_times) if self.step_times else np.zeros(1)
        return {
            "values": self.controls.values(),
            "given": self.controls.given.get("substeps"),
            "stable": self.controls.stable_substeps,
            "dt": self.adapter.fixed_step.dt,
            "time": self.world.time,
            "is_paused": not self.is_playing,
            "step_ms": [round(1e3 * float(q), 3) for q in np.percentile(times, (50, 99))],
            "factor": round(self._factor, 3),
            "energies": self._energies,
            "frozen": sum(body.is_frozen for body in self.world.bodies),
            "bodies": len(self.world.bodies),
            "scale": None if self.tints is None else self.tints.scale,
            "palette": sorted(palette_of(self.world)),
            "restarts": self.scene.act is not None,
            "hash": None if self.is_playing else self.world.state_hash(),
        }

    def _renew_adapter(self) -> None:
        self.adapter = adapter_of(self.scene, self.controls.substeps, self._before_step)
