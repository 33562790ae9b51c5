"""Step a live world and write its frames. This process uses no network and never waits for visitors."""

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
"""Largest number of frames per second."""

TOLD = 5.0
"""Rate at which measurements are reported to the page [1/s]."""

SHARE = 0.05
"""Largest fraction of time that is spent on the computation of colours."""

MOST_HELD = 8
"""Largest number of simultaneous grabs of all visitors."""

ANSWERING = 0.008
"""Time for requests between two steps [s]: half the duration of a frame. Remaining requests wait."""


def words_of(error: BaseException) -> str:
    """Return the message of an error. The type of the error precedes it, except for a TaichiSoftError."""
    text = str(error) or type(error).__name__
    return text if isinstance(error, TaichiSoftError) else f"{type(error).__name__}: {text}"


class Simulation:
    """A live world and the grabs of its visitors."""

    def __init__(self, connection: Connection, folder: Path, scene: Scene, source: SceneSource) -> None:
        self.connection, self.folder, self.scene, self.source = connection, folder, scene, source
        self.world = scene.world
        self.controls = Controls(self.world, scene.step.dt, scene.step.substeps)
        self.adapter: EngineAdapter = adapter_of(scene, self.controls.substeps, self._before_step)
        self.first = b""  # snapshot of the initial state
        self.is_playing, self.is_moving = False, True  # the server starts a world when it is shown
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
        # For each visitor, the first move that no frame shows yet: its number, and the step count on arrival.
        self._pulls: dict[int, tuple[int, int]] = {}
        self._alpha: float | None = None  # interpolation factor if another program steps the world, else None

    def start(self, given: Given) -> None:
        """Compile all kernels that requests need, and send the meshes."""
        self.world.warm_up()
        self.first = self.world.snapshot()
        self.controls.give(given)
        self._renew_adapter()
        self.describe()
        self.draw(time.perf_counter(), True)
        self.connection.send(("ready", self._told()))

    def look(self, alpha: float) -> None:
        """Execute requests and write a frame of a world that another program steps.

        Args:
            alpha: interpolation between the previous step (0) and the last one (1).
        """
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
        """Execute requests for a limited time. Returns: False if the server ends the world."""
        while self.connection.poll():
            sender, key, message = self.connection.recv()
            if message[0] == "stop":
                return False
            ends = {"is_kept": message[0] == "release", "is_last": message[0] == "leave"}
            if not self.inbox.put(sender, message, key, **ends):
                self._refuse(sender, "too many of your requests are waiting: this one is skipped")
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
        """Execute a request. If it fails, report the reason to the sender."""
        name, *arguments = message
        try:
            getattr(self, f"do_{name}")(*arguments)
        except Exception as error:
            self._refuse(sender, words_of(error))
        if self.drawn.is_outdated:  # done here, so that the visitor is charged for the time
            self.describe()
        self.is_moving = True

    def _refuse(self, sender: int, words: str) -> None:
        self.connection.send(("said", words) if sender == SERVER else ("refused", sender, words))

    @contextmanager
    def _undoable(self, what: str, *, is_slider: bool = False) -> Iterator[None]:
        """Return a context that records the state before a change, unless the change fails.

        In a scene with its own code, only sliders can be undone, because a snapshot does not contain the
        state of that code.
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
        """Advance the world by a time [s]. If a step fails, pause the world and report the reason."""
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
        self.is_moving = True  # interpolated positions also change between two steps
        for each in caught:
            # The page itself warns of instability, and only for the materials of existing bodies.
            if not issubclass(each.category, UnstableStepWarning):
                self.connection.send(("said", str(each.message)))

    # Requests of visitors

    def do_set(self, name: str, value: float) -> None:
        """Set a slider to a value, and apply it to the world."""
        before = self.controls.substeps
        with self._undoable(SLIDERS[name].label, is_slider=True):
            self.controls.set_value(name, value)
        if self.controls.substeps != before:
            self._renew_adapter()
        self._due["told"] = 0.0

    def do_preset(self, name: str | None) -> None:
        """Set the material sliders to a preset; None restores the scene's values."""
        with self._undoable("Preset", is_slider=True):
            self.controls.give(self.controls.sliders.with_preset(name))
        self._renew_adapter()

    def do_give(self, given: Given) -> None:
        """Set all sliders to the values of another world."""
        self.controls.give(given)
        self._renew_adapter()

    def do_undo(self) -> None:
        """Restore the state before the last change."""
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
        """Clear the history. If `is_first` and no slider is set, later resets restore the current state."""
        self.history.clear()
        if is_first and not self.controls.given:
            self.first = self.world.snapshot()

    def do_pause(self, is_paused: bool) -> None:
        """Pause the world or continue."""
        self.is_playing = not is_paused
        self._pulls.clear()  # latency must not include a pause
        self._due["told"] = 0.0

    def do_step(self) -> None:
        """Pause the world and make one step."""
        self.is_playing = False
        self.meters.begin()
        self.adapter.step()
        self.meters.end(self.adapter.fixed_step.dt)
        self._due["told"] = 0.0

    def do_reset(self) -> None:
        """Restore the initial state, and set all sliders to the scene's values or to the chosen preset.

        The server restarts scenes with their own code, because a snapshot does not contain the state
        of that code.
        """
        with self._undoable("Reset"):
            self.do_release_all()
            self.world.restore(self.first)
            sliders = self.controls.sliders
            self.controls.record(Given())
            self.controls.give(sliders.at_reset())
        self._renew_adapter()

    def do_grab(self, visitor: int, origin: list[float], direction: list[float]) -> None:
        """Grab the first body that a ray hits; `origin` [m] and `direction` define the ray."""
        self.do_release(visitor)
        if len(self.hands) >= MOST_HELD:
            raise TaichiSoftError(f"{MOST_HELD} bodies are grabbed already: release one first")
        grab = self.world.grab(origin, direction)
        if grab is not None:
            self.hands[visitor] = grab

    def do_move(self, visitor: int, point: list[float], number: int = 0) -> None:
        """Move a visitor's grab to a point [m]; `number` identifies the move."""
        grab = self.hands.get(visitor)
        if grab is not None and grab.is_held:
            grab.move(point)
            if number and self.is_playing:
                self._pulls.setdefault(visitor, (number, self.world.step_count))

    def do_release(self, visitor: int) -> None:
        """Release a visitor's grab; the body keeps its velocity."""
        grab = self.hands.pop(visitor, None)
        if grab is not None and grab.is_held:
            grab.release()

    def do_leave(self, visitor: int) -> None:
        """Release the grab of a visitor who has left."""
        self.do_release(visitor)

    def do_release_all(self) -> None:
        """Release all grabs."""
        for visitor in list(self.hands):
            self.do_release(visitor)

    def do_spawn(self, name: str) -> None:
        """Add a body from the palette above the centre of the view."""
        palette = palette_of(self.world)
        if name not in palette:
            raise TaichiSoftError(f"unknown shape {name!r}: choose one of {', '.join(palette) or 'none'}")
        target = np.array(self.scene.camera.target)
        number = len(self.world.bodies)
        spot = target + 0.35 * np.array([np.cos(2.4 * number), np.sin(2.4 * number), 0.0])
        low = palette[name].mesh.bounds[0]
        height = max(float(target[2]) + 1.0, (self.world.settings.floor or 0.0) + 1.5)
        with self._undoable(f"Add {name}"):
            body = self.world.spawn(palette[name], position=(*spot[:2], height - float(low[2])))
            self.controls.greet(body)

    def do_despawn(self) -> None:
        """Remove the last body that a visitor added."""
        added = {id(asset) for asset in palette_of(self.world).values()}
        mine = [body for body in self.world.bodies if id(body.asset) in added]
        if not mine:
            raise TaichiSoftError("no visitor's body is left to remove")
        with self._undoable("Remove last"):
            self.world.despawn(mine[-1])

    def do_tint(self, quantity: str | None) -> None:
        """Colour bodies by a quantity; None restores their own colours."""
        self.tints = None if quantity is None else Tints(quantity)
        if self.tints is not None:
            self.tints.renew(self.world)

    def do_motion(self) -> None:
        """Send the motion of all bodies to the server, which passes it to the next world."""
        self.connection.send(("motion", motion_of(self.controls)))

    def do_take_motion(self, motion: Motion) -> None:
        """Give all bodies the motion of another world."""
        continue_from(self.controls, motion)

    def do_save(self, number: int) -> None:
        """Send the script of this world and a snapshot to the server; `number` is the visitor."""
        snapshot = self.world.snapshot()
        step = self.adapter.fixed_step
        text = saved_script(self.source, self.world.state_hash(), step.dt, self.controls.substeps)
        self.connection.send(("saved", number, text, snapshot))

    def do_film(self, number: int) -> None:
        """Write the frames of the last seconds to a file, for a film; `number` is the visitor."""
        path = self.folder / f"film{number}.npz"
        try:
            film_frames(path, self.recent.rows(), self.drawn)
        except Exception:
            self.connection.send(("filmed", number, ""))
            raise
        self.connection.send(("filmed", number, str(path)))

    # Output

    def draw(self, now: float, is_moving: bool) -> None:
        """Write a frame if one is due and something moved. `now` is the current time [s]."""
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
        """Make the meshes again after bodies changed, and send them to the server."""
        self.versions += 1
        self.drawn = Drawn(self.scene, self.versions)
        path = self.folder / f"frames{self.versions}"
        self.frames = FrameFile(path, self.drawn.vertex_count, len(self.drawn.colliders), is_new=True)
        self.recent.clear()
        with suppress(OSError):  # Windows cannot remove a file in use
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
