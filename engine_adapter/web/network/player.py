"""Player of the network sample in Python. `play.py` starts it, and also starts `player.mjs` in Node.js."""

import argparse
import json
import socket
import time
from typing import Any

from engine_adapter import FixedStep, RollbackSession
from engine_adapter.session import Inputs
from engine_adapter.web.network.arena import players, stage, world

STEP = FixedStep(dt=1 / 60, substeps=8)
FORCE, LIFT = 8.0, 0.02  # force per unit of input [N]; height by which each player raises the stage [m]


def act(inputs: Inputs) -> None:
    """Apply the inputs of a tick. An input has three bytes: 100 + x, 100 + y, and 1 to raise the stage, else
    0.
    """
    for body, (x, y, _) in zip(players, inputs, strict=True):
        body.apply_force((FORCE * (x - 100), FORCE * (y - 100), 0.0))
    stage.move_to((0.0, 0.0, LIFT * (inputs[0][2] + inputs[1][2])))


def press(tick: int, player: int) -> bytes:
    """Return a player's input in a tick. The direction changes about three times per second."""
    turn = tick // (17 + 6 * player)
    return bytes(
        [(37 * turn + 91 * player) % 201, (59 * turn + 13 * player) % 201, int(tick % 50 < 5 + player)]
    )


class Player:
    """One player: a session, the socket to the other machine, and timings."""

    def __init__(self, line: socket.socket, player: int, ticks: int, cheat: int) -> None:
        self.line, self.player, self.ticks, self.cheat = line, player, ticks, cheat
        self.session = RollbackSession(world, self.act, player=player, input_size=3, step=STEP)
        self.frames = self.remade = 0
        self.seconds = 0.0  # time for repeated ticks [s]

    def act(self, inputs: Inputs) -> None:
        """Apply inputs. A cheating player changes one bit in one tick."""
        if world.step_count == self.cheat:
            inputs = (bytes([inputs[0][0] ^ 1, *inputs[0][1:]]), inputs[1])
        act(inputs)

    def frame(self) -> None:
        """Make a tick and send a message. If this machine is ahead of the other machine, sometimes skip a
        tick.
        """
        session = self.session
        start = time.perf_counter()
        made = session.settle()
        self.seconds += (time.perf_counter() - start) if made else 0.0
        self.remade += made
        self.frames += 1
        is_ahead = session.ahead > 1 and self.frames % 10 == 0
        if session.tick < self.ticks and not is_ahead:
            session.advance(press(session.tick, self.player))
        self.line.send(session.message())
        self.line.send(b"done" if session.confirmed >= self.ticks == session.tick else b"frame")

    def report(self) -> dict[str, Any]:
        """Return a summary of the game for `play.py`."""
        session = self.session
        session.settle()
        return {
            "hash": world.bodies_hash(),
            "ticks": session.tick,
            "rollbacks": session.rollbacks,
            "longest": session.longest_rewind,
            "remade": self.remade,
            "ms": 1e3 * self.seconds / max(self.remade, 1),
            "desync": session.desync,
            "ahead": session.ahead,
        }


def play(player: Player, is_fast: bool) -> None:
    """Play until `play.py` reports that both players know all inputs.

    Args: is_fast: True if `play.py` also controls the clock.
    """
    due = time.monotonic()
    while True:
        if not is_fast:
            player.line.settimeout(max(due - time.monotonic(), 1e-4))
        try:
            data = player.line.recv(65536)
        except TimeoutError:
            due += STEP.dt
            player.frame()
            continue
        if data == b"end":
            return
        if data == b"frame":
            player.frame()
        else:
            player.session.receive(data)


def main() -> None:
    """Play over the local port that is passed on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--ticks", type=int, required=True)
    parser.add_argument("--cheat", type=int, default=-1)
    parser.add_argument("--fast", action="store_true")
    options = parser.parse_args()
    world.warm_up()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.connect(("127.0.0.1", options.port))
        player = Player(line, 0, options.ticks, options.cheat)
        line.send(b"ready")
        line.recv(16)  # receives "start"
        play(player, options.fast)
    print(json.dumps(player.report()))


if __name__ == "__main__":
    main()
