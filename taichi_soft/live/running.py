"""Entry point of a live world's process: make the scene, report progress, and step the world."""

from __future__ import annotations

import traceback
import warnings
from multiprocessing.connection import Connection
from pathlib import Path

from taichi_soft.core.compilation import BURST, shown_by
from taichi_soft.live.controls import Given
from taichi_soft.live.scene import SceneSource, made_scene
from taichi_soft.live.simulation import Simulation, words_of


def run(connection: Connection, folder: str, source: SceneSource, given: Given) -> None:
    """Make a scene and step it until the message "stop" arrives. Errors are reported, not raised.

    Incoming messages are `(sender, key, (name, *arguments))`, with the arguments of `Simulation.do_NAME`.
    Outgoing messages are ("progress", step, kernels), ("ready", state), ("drawn", ...),
    ("frame", number, pulls), ("state", state), ("said", words), ("refused", visitor, words), ("saved", ...),
    ("filmed", ...), ("motion", ...), ("failed", words).
    """
    from taichi_soft import init

    def show(text: str) -> None:
        if text:
            step = "compiling" if BURST.made else "loading"
            connection.send(("progress", step, BURST.made + BURST.found))

    warnings.simplefilter("always")
    try:
        with shown_by(show):
            init("cpu")
            connection.send(("progress", "building", 0))
            simulation = Simulation(connection, Path(folder), made_scene(source), source)
            simulation.start(given)
    except BaseException as error:
        connection.send(("failed", words_of(error)))
        return
    try:
        simulation.play()
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return
    except BaseException as error:
        traceback.print_exc()
        connection.send(("failed", words_of(error)))
