"""The process that steps a world and writes its frames. It uses no network, and waits for nobody."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from engine_adapter import EngineAdapter
from taichi_soft import Grab, World
from taichi_soft.core.errors import StateError, TaichiSoftError, UnstableStepWarning
from taichi_soft.live.choices import palette_of
from taichi_soft.live.controls import SLIDERS, Controls, Given
from taichi_soft.live.drawn import Drawn
from taichi_soft.live.frame_file import FrameFile
from taichi_soft.live.history import Before, History
from taichi_soft.live.inbox import SERVER, Inbox
from taichi_soft.live.meters import Meters
from taichi_soft.live.motion import Motion, continue_from, motion_of
from taichi_soft.live.saving import Recent, film_frames, saved_script
from taichi_soft.live.scene import Scene, SceneSource, adapter_of
from taichi_soft.live.tints import Tints

FRAMES = 60.0
"""Largest number of frames a second."""

TOLD = 5.0
"""Reports of numbers a second."""

SHARE = 0.05
"""Largest fraction of the time for colours."""

MOST_HELD = 8
"""Bodies that visitors hold at a time."""

ANSWERING = 0.008
"""Time after which no further request is begun before the next step [s]: half of a frame."""


def words_of(error: BaseException) -> str:
    """Return the message of an error, with its type unless it is one of ours."""
    text = str(error) or type(error).__name__
    return text if isinstance(error, TaichiSoftError) else f"{type(error).__name__}: {text}"


class Simulation:
    """One world with its visitors' hands in it."""

    def __init__(self, connection: Connection, folder: Path, scene: Scene, source: SceneSource) -> None:
        self.connection, self.folder, self.scene, self.source = connection, folder, scene, source
        self.world = scene.world
        self.controls = Controls(self.world, scene.step.dt, scene.step.substeps)
        self.adapter: EngineAdapter = adapter_of(scene, self.controls.substeps, self._before_step)
        self.first = b""  # its state before anything moved
        self.is_playing, self.is_moving = False, True  # until it is shown
        self.hands: dict[int, Grab] = {}
        self.inbox, self.history = Inbox(), History()
        self.tints: Tints | None = None
        self.meters = Meters(self.world)
        self.recent = Recent()
        self.versions = 0
        self.drawn: Drawn
        self.frames: FrameFile
        self._due = {"frame": 0.0, "told": 0.0, "tints": 0.0}
        self._steps_seen = 0
        self._pulls: dict[int, tuple[int, int]] = {}  # by visitor: a move that no frame shows, the step
        self._alpha: float | None = None  # of a world that somebody else steps

    def start(self, given: Given) -> None:
        """Compile everything that a visitor can ask for, and send what is drawn."""
        self.world.warm_up()
        self.first = self.world.snapshot()
        self.controls.give(given)
        self._renew_adapter()
        self.describe()
        self.draw(time.perf_counter(), True)
        self.connection.send(("ready", self._told()))

    def look(self, alpha: float) -> None:
        """Answer requests, and show a world that another program steps."""
        self._answer()
        if self.world.step_count != self._steps_seen:
            self._steps_seen, self.is_moving = self.world.step_count, True
        self._alpha = alpha
        self.draw(time.perf_counter(), self.is_moving)
        self._tell(time.perf_counter())

    def play(self) -> None:
        """Step the world until the server stops it."""
        last = time.perf_counter()
        while self._answer():
            now = time.perf_counter()
            if self.is_playing:
                self._advance(min(now - last, 0.25) * self.controls.given.get("speed", 1.0))
            last = now
            self.draw(time.perf_counter(), self.is_moving)
            self._tell(time.perf_counter())
            left = last + self.adapter.fixed_step.dt / 2 - time.perf_counter()
            self.connection.poll(max(left, 0.0005) if self.is_playing else 0.02)

    def _answer(self) -> bool:
        """Answer requests for a part of a frame's time. Returns: False if the server ends the world."""
        while self.connection.poll():
            sender, key, message = self.connection.recv()
            if message[0] == "stop":
                return False
            ends = {"is_kept": message[0] == "release", "is_last": message[0] == "leave"}
            if not self.inbox.put(sender, message, key, **ends):
                self._refuse(sender, "too many of your requests wait: this one is left out")
        end = time.perf_counter() + ANSWERING
        while (now := time.perf_counter()) < end:
            taken = self.inbox.take(now)
            if taken is None:
                break
            self._obey(*taken)
            after = time.perf_counter()
            self.inbox.charge(taken[0], after, after - now)
        return True

    def _obey(self, sender: int, message: tuple[Any, ...]) -> None:
        """Do what one request asks for. One that fails is refused, and changes nothing."""
        name, *arguments = message
        try:
            getattr(self, f"do_{name}")(*arguments)
        except Exception as error:
            self._refuse(sender, words_of(error))
        if self.drawn.is_outdated:  # counts as time of this visitor
            self.describe()
        self.is_moving = True

    def _refuse(self, sender: int, words: str) -> None:
        self.connection.send(("said", words) if sender == SERVER else ("refused", sender, words))

    @contextmanager
    def _undoable(self, what: str, *, is_slider: bool = False) -> Iterator[None]:
        """Record the state before a change, unless the change fails.

        In a scene with code of its own, only sliders can be undone: no snapshot contains what that code
        remembers.
        """
        has_code, now = self.scene.act is not None, time.perf_counter()
        if (has_code and not is_slider) or (is_slider and self.history.goes_on(what, now)):
            yield
            return
        snapshot = None if has_code else self.world.snapshot()
        before = Before(what, self.controls.sliders, snapshot, tuple(self.hands.values()))
        yield
        self.history.add(before, drag_at=now if is_slider else None)

    def _before_step(self, world: World) -> None:
        if self.scene.act is not None:
            self.scene.act(world)
        self.meters.begin_step()

    def _advance(self, seconds: float) -> None:
        """Let time go on. A step that fails stops the world, which says why."""
        before = self.world.step_count
        self.meters.begin()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                self.adapter.advance(seconds)
            except Exception as error:
                self.is_playing = False
                self.connection.send(("said", f"stopped: {words_of(error)}"))
        self.meters.end((self.world.step_count - before) * self.adapter.fixed_step.dt)
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
        with self._undoable(SLIDERS[name].label, is_slider=True):
            self.controls.set_value(name, value)
        if self.controls.substeps != before:
            self._renew_adapter()
        self._due["told"] = 0.0

    def do_preset(self, name: str | None) -> None:
        """Give the sliders of the material the values of a preset; None: those of the scene."""
        with self._undoable("Preset", is_slider=True):
            self.controls.give(self.controls.sliders.with_preset(name))
        self._renew_adapter()

    def do_give(self, given: Given) -> None:
        """Give all sliders the values that they have in another world."""
        self.controls.give(given)
        self._renew_adapter()

    def do_undo(self) -> None:
        """Go back to the state before the last change."""
        before = self.history.pop()
        if before is None:
            raise StateError("there is no change to undo")
        if before.snapshot is None:
            self.controls.give(before.sliders)
        else:
            self.do_release_all()
            self.world.restore(before.snapshot)
            for grab in before.held:
                if grab.is_held:
                    grab.release()
            self.controls.record(before.sliders)
        self._renew_adapter()

    def do_settle(self, is_first: bool) -> None:
        """Start with an empty history; the first world of a pane resets to its present state."""
        self.history.clear()
        if is_first and not self.controls.given:
            self.first = self.world.snapshot()

    def do_pause(self, is_paused: bool) -> None:
        """Stop, or go on."""
        self.is_playing = not is_paused
        self._pulls.clear()  # a pause is no latency
        self._due["told"] = 0.0

    def do_step(self) -> None:
        """Make one step of a world that stands."""
        self.is_playing = False
        self.meters.begin()
        self.adapter.step()
        self.meters.end(self.adapter.fixed_step.dt)
        self._due["told"] = 0.0

    def do_reset(self) -> None:
        """Go back to the beginning, and all sliders to the scene's values or those of the preset.

        The server makes a scene with code of its own anew: no snapshot contains what that code remembers.
        """
        with self._undoable("Reset"):
            self.do_release_all()
            self.world.restore(self.first)
            sliders = self.controls.sliders
            self.controls.record(Given())
            self.controls.give(sliders.at_reset())
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

    def do_leave(self, visitor: int) -> None:
        """Let go of what a visitor held who has left."""
        self.do_release(visitor)

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
        with self._undoable(f"Add {name}"):
            body = self.world.spawn(palette[name], position=(*spot[:2], height - float(low[2])))
            self.controls.greet(body)

    def do_despawn(self) -> None:
        """Remove the body that a visitor added last."""
        added = {id(asset) for asset in palette_of(self.world).values()}
        mine = [body for body in self.world.bodies if id(body.asset) in added]
        if not mine:
            raise TaichiSoftError("no body was added that could be removed")
        with self._undoable("Remove last"):
            self.world.despawn(mine[-1])

    def do_tint(self, quantity: str | None) -> None:
        """Colour bodies by a quantity, or by themselves."""
        self.tints = None if quantity is None else Tints(quantity)
        if self.tints is not None:
            self.tints.renew(self.world)

    def do_motion(self) -> None:
        """Send where all bodies are, for a world with another law to continue from."""
        self.connection.send(("motion", motion_of(self.controls)))

    def do_take_motion(self, motion: Motion) -> None:
        """Continue from where the bodies of another world are."""
        continue_from(self.controls, motion)

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
            film_frames(path, self.recent.rows(), self.drawn, self.scene)
        except Exception:
            self.connection.send(("filmed", number, ""))
            raise
        self.connection.send(("filmed", number, str(path)))

    # What is told.

    def draw(self, now: float, is_moving: bool) -> None:
        """Write a frame if it is time for one and something moved."""
        if self.drawn.is_outdated:
            self.describe()
            is_moving = True
        if self.tints is not None and now >= self._due["tints"]:
            self.tints.renew(self.world)
            self._due["tints"] = now + (time.perf_counter() - now) / SHARE
            is_moving = True
        if not is_moving or now < self._due["frame"]:
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
        self.recent.add(now, moment, self.drawn, frame)
        self._due["frame"] = now + 1.0 / FRAMES - 0.001
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
        self._due["told"] = now + 1.0 / TOLD
        self.connection.send(("state", self._told()))

    def _told(self) -> dict[str, Any]:
        return {
            "values": self.controls.values(),
            "given": dict(self.controls.given),
            "preset": self.controls.preset,
            "undo": self.history.last,
            "stable": self.controls.stable_substeps,
            "dt": self.adapter.fixed_step.dt,
            "time": self.world.time,
            "is_paused": not self.is_playing,
            **self.meters.values(time.perf_counter()),
            "frozen": sum(body.is_frozen for body in self.world.bodies),
            "bodies": len(self.world.bodies),
            "scale": None if self.tints is None else self.tints.scale,
            "palette": sorted(palette_of(self.world)),
            "restarts": self.scene.act is not None,
            "hash": None if self.is_playing else self.world.state_hash(),
        }

    def _renew_adapter(self) -> None:
        self._due["told"] = 0.0
        self.adapter = adapter_of(self.scene, self.controls.substeps, self._before_step)
