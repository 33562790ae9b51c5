"""Play a game between Python and node over a slow, lossy network, and compare the two worlds.

    .venv/bin/python engine_adapter/web/network/play.py           # in real time
    .venv/bin/python engine_adapter/web/network/play.py --fast    # the same game on a simulated clock

Each player is a process that sends UDP datagrams to this process. This process simulates the network: it
delays, loses, copies and reorders datagrams.
"""

import argparse
import heapq
import json
import random
import selectors
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
DT = 1 / 60
NAMES = ("Python", "node")  # names of the players
DELAY, JITTER, STALL = 0.1, 0.05, 0.2  # delay of each message, largest random delay, delay of a stall [s]
LOST, STALLED, COPIED = 0.1, 0.02, 0.02  # fractions of messages lost, delayed by STALL, and sent twice
LATE_START = (0, 20)  # frame in which each player begins
PATIENCE = 60.0  # time after which a silent process counts as failed [s]


class Network:
    """Messages in transit. Their delays follow from a seed, so that `--fast` is reproducible."""

    def __init__(self, seed: int) -> None:
        self._rng, self._newest = random.Random(seed), [0, 0]
        self._way: list[tuple[float, int, int, bytes]] = []  # messages in transit, the next to arrive first
        self.counts: Counter[str] = Counter()

    def send(self, now: float, to: int, data: bytes) -> None:
        """Send a message to player `to` at time `now` [s]."""
        rng = self._rng
        self.counts["sent"] += 1
        if rng.random() < LOST:
            self.counts["lost"] += 1
            return
        is_copied = rng.random() < COPIED
        self.counts["copied"] += is_copied
        for _ in range(1 + is_copied):
            due = now + DELAY + rng.uniform(0, JITTER) + (STALL if rng.random() < STALLED else 0.0)
            heapq.heappush(self._way, (due, self.counts["sent"], to, data))

    def due(self, now: float) -> Iterator[tuple[int, bytes]]:
        """Yield the messages that have arrived by time `now` [s], each as (receiving player, bytes)."""
        while self._way and self._way[0][0] <= now:
            _, number, to, data = heapq.heappop(self._way)
            self.counts["overtaken"] += number < self._newest[to]
            self._newest[to] = max(number, self._newest[to])
            yield to, data

    def next(self, now: float) -> float:
        """Return the time until the next message arrives [s]."""
        return max(self._way[0][0] - now, 0.0) if self._way else DT


class Line:
    """Socket to the process of a player."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE)
        self.port = self.socket.getsockname()[1]

    def meet(self, process: subprocess.Popen[str], name: str) -> None:
        """Wait until the player has connected. Raises: ChildProcessError if the process has ended."""
        self.socket.settimeout(0.1)
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            try:
                self.socket.connect(self.socket.recvfrom(16)[1])
            except TimeoutError:
                if process.poll() is not None:
                    break
            else:
                self.socket.settimeout(PATIENCE)
                return
        raise ChildProcessError(f"{name} did not start")

    def send(self, data: bytes) -> None:
        """Send a datagram to the player."""
        self.socket.send(data)

    def receive(self) -> bytes:
        """Return a datagram from the player."""
        return self.socket.recv(65536)


def run_fast(lines: list[Line], network: Network) -> None:
    """Run both players on one simulated clock until both have finished."""
    state, frame = [b"frame", b"frame"], 0
    while state != [b"done", b"done"]:
        now = frame * DT
        for to, data in network.due(now):
            lines[to].send(data)
        awake = [player for player in (0, 1) if frame >= LATE_START[player]]
        for player in awake:
            lines[player].send(b"frame")
        for player in awake:
            while len(data := lines[player].receive()) > 8:
                network.send(now, 1 - player, data)
            state[player] = data
        frame += 1


def run(lines: list[Line], network: Network) -> None:
    """Forward messages in real time until both players have finished."""
    state, heard = [b"frame", b"frame"], time.monotonic()
    with selectors.DefaultSelector() as selector:
        for player, line in enumerate(lines):
            selector.register(line.socket, selectors.EVENT_READ, player)
        while state != [b"done", b"done"]:
            now = time.monotonic()
            for to, data in network.due(now):
                lines[to].send(data)
            if now - heard > PATIENCE:
                raise TimeoutError(f"neither process has sent anything for {PATIENCE:g} s")
            for key, _ in selector.select(network.next(now)):
                heard = now
                data = lines[key.data].receive()
                if len(data) > 8:
                    network.send(now, 1 - key.data, data)
                else:
                    state[key.data] = data


def session(
    folder: Path, *, ticks: int, seed: int, is_fast: bool, cheat: int | None = None
) -> tuple[list[dict[str, Any]], Counter[str]]:
    """Run both processes. Returns: the reports of the players, and the message counts of the network."""
    lines, network = [Line(), Line()], Network(seed)
    commands: list[list[str | Path]] = [
        [sys.executable, HERE / "player.py", *([] if cheat is None else ["--cheat", str(cheat)])],
        ["node", HERE / "player.mjs", folder],
    ]
    options = ["--ticks", str(ticks), *(["--fast"] if is_fast else [])]
    processes = [
        subprocess.Popen([*command, "--port", str(line.port), *options], stdout=subprocess.PIPE, text=True)
        for command, line in zip(commands, lines, strict=True)
    ]
    try:
        for line, process, name in zip(lines, processes, NAMES, strict=True):
            line.meet(process, name)
        for line in lines:
            line.send(b"start")
        (run_fast if is_fast else run)(lines, network)
        for line in lines:
            line.send(b"end")
        reports = [
            json.loads(process.communicate(timeout=PATIENCE)[0].splitlines()[-1]) for process in processes
        ]
    finally:
        for process in processes:
            process.kill()
            process.wait()
        for line in lines:
            line.socket.close()
    return reports, network.counts


def export(folder: Path) -> None:
    """Export the world of the players for Node.js."""
    command = ["export", str(HERE / "arena.py"), "--out", str(folder), "--for", "web"]
    done = subprocess.run([sys.executable, "-m", "taichi_soft", *command], stdout=subprocess.DEVNULL)
    if done.returncode != 0:
        sys.exit(
            f"{sys.executable} could not export the world, for the reason above. "
            "In a checkout where `make setup` was run, use .venv/bin/python"
        )


def main() -> None:
    """Play a game, print a summary, and exit with an error if the worlds differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--fast", action="store_true", help="on a simulated clock, as fast as both can")
    parser.add_argument("--ticks", type=int, default=3600, help="of 1/60 s (default 3600)")
    parser.add_argument("--seed", type=int, default=1, help="of the network (default 1)")
    parser.add_argument("--cheat", type=int, metavar="TICK", help="change a bit in Python's world")
    parser.add_argument("--world", type=Path, help="folder of a world that is already exported")
    options = parser.parse_args()
    if options.ticks < 1:
        parser.error(f"--ticks is {options.ticks}: give 1 or more")
    if options.cheat is not None and not 0 <= options.cheat < options.ticks:
        parser.error(f"--cheat is {options.cheat}: give a tick from 0 to {options.ticks - 1}")
    if options.world is not None and not (options.world / "kernels" / "web.wasm").is_file():
        parser.error(f"--world is {options.world}: give a folder from taichi-soft export --for web")
    if shutil.which("node") is None:
        sys.exit("needs node: apt-get install nodejs")
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.world or Path(scratch) / "arena.softworld"
        if options.world is None:
            export(folder)
        asked = dict(ticks=options.ticks, seed=options.seed, is_fast=options.fast, cheat=options.cheat)
        try:
            reports, counts = session(folder, **asked)
        except (ChildProcessError, TimeoutError) as error:
            sys.exit(f"the game stopped early, for the reason above: {error}")
    print(", ".join(f"{counts[name]:,} {name}" for name in ("sent", "lost", "copied", "overtaken")))
    for name, found in zip(NAMES, reports, strict=True):
        print(
            f"{name}: {found['ticks']:,} ticks, {found['rollbacks']:,} rollbacks, the longest "
            f"{found['longest']} ticks; {found['remade']:,} ticks repeated, {found['ms']:.2f} ms each; "
            f"hash {found['hash']}"
        )
        if found["desync"] is not None:
            print(f"{name}: the worlds differ at tick {found['desync']}")
    if reports[0]["hash"] != reports[1]["hash"]:
        sys.exit("the worlds differ at the end")


if __name__ == "__main__":
    main()
