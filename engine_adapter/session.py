"""Rollback netcode: the session of one machine in a network game whose inputs arrive late."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from engine_adapter.fixed_step import FixedStep
from engine_adapter.rollback import Rollback
from taichi_soft import OptionError, TaichiSoftError, World
from taichi_soft.core.checks import as_count

Inputs = tuple[bytes, ...]
"""Inputs of all players in one tick, in the order of the players."""

MARK, NO_TICK = b"TSR1", 0xFFFFFFFF
HEAD = struct.Struct("<4sQBBHHHIIQIH")
LEAD_SMOOTHING = 0.1  # weight of the newest message in the estimate of how far ahead this machine is


class SessionError(TaichiSoftError, ValueError):
    """Raised for a message that does not belong to the session, and for a player who has been silent for too
    long.
    """


class _Message(NamedTuple):
    """Contents of a message: the fields of `HEAD`, the number of known ticks of each player, and inputs."""

    mark: bytes
    start: int  # hash of the session's initial state
    player: int
    players: int
    input_size: int
    ticks: int
    hash_every: int
    tick: int  # next tick of the sender
    hash_tick: int  # tick of the newest hash that late inputs cannot change, or NO_TICK
    hash: int
    first: int  # tick of the first input in the message
    input_count: int
    heard: tuple[int, ...]
    inputs: list[bytes]


class RollbackSession:
    """Makes ticks with predicted inputs, and repeats them if a prediction was wrong.

    Each machine runs the same world and has its own session. `advance` makes a tick with the input of the own
    player, and predicts that the other players repeat their last known inputs. `message` returns a datagram
    for all other machines, and `receive` reads a datagram from one of them. Datagrams can arrive late, twice,
    in any order or not at all, because each datagram repeats all inputs that were not acknowledged. Give all
    machines the same arguments. Only `act`, `player`, `delay` and `patience` may differ.

    Args:
        world: built world. All machines must build it with the same script, and start at the same step count.
        act: function that receives the inputs of all players, in their order, and applies them before each
            step. The function must depend only on the inputs and the world, because ticks can be repeated.
        player: number of the own player, from 0.
        players: number of players, 2 to 16.
        input_size: size of an input [bytes], 1 to 64. Before the first input of a player, all bytes are 0.
        step: length and substeps of each tick.
        ticks: largest number of ticks made on predictions, 1 to 1000. Each tick takes the memory of a
            snapshot.
        delay: ticks until an own input takes effect, 0 to `ticks`. A larger delay shortens rewinds and
            increases input latency.
        hash_every: ticks between comparisons of hashes, 1 to 10000.
        patience: number of consecutive `advance` calls that make no tick, after which `advance` raises an
            error.
    Raises: OptionError for an argument out of range; StateError if the world is not built.
    Example:
        session = RollbackSession(world, lambda inputs: None, player=0, input_size=1)
        session.advance(b"\\x01")  # True: the tick was made
        datagram = session.message()  # for the others' `receive`
    """

    def __init__(
        self,
        world: World,
        act: Callable[[Inputs], None],
        *,
        player: int,
        players: int = 2,
        input_size: int,
        step: FixedStep | None = None,
        ticks: int = 30,
        delay: int = 0,
        hash_every: int = 60,
        patience: int = 600,
    ) -> None:
        step = FixedStep() if step is None else step
        if not callable(act):
            raise OptionError(f"act must be a function of the inputs, got {act!r}")
        if not isinstance(step, FixedStep):
            raise OptionError(f"step must be a FixedStep, got {type(step).__name__}")
        self._players = as_count(players, "players", 2, 16)
        self._player = as_count(player, "player", 0, self._players - 1)
        self._input_size = as_count(input_size, "input_size", 1, 64)
        self._ticks = as_count(ticks, "ticks", 1, 1000)
        self._delay = as_count(delay, "delay", 0, self._ticks)
        self._hash_every = as_count(hash_every, "hash_every", 1, 10_000)
        self._patience = as_count(patience, "patience")
        self._rollback = Rollback(world, self._ticks)
        self._world, self._act, self._step = world, act, step
        self._others = [each for each in range(self._players) if each != self._player]
        self._start = int(world.bodies_hash(), 16)
        self._tick = first = world.step_count
        blank = bytes(self._input_size)
        self._inputs = [{first - 1: blank} for _ in range(self._players)]  # per player, known inputs by tick
        self._used: dict[int, Inputs] = {}  # inputs of all players that each tick used
        self._heard = [first] * self._players  # per player, the first tick without a known input
        self._acknowledged = [first] * self._players  # per player, first own input not acknowledged
        for _ in range(self._delay):
            self._learn(self._player, blank)
        self._wrong: int | None = None  # first tick with a wrong prediction
        self._hashes: dict[int, int] = {}  # hashes of own states, by tick
        # Received hashes that are not yet compared, by (tick, player).
        self._their_hashes: dict[tuple[int, int], int] = {}
        self._newest = [first] * self._players  # tick of the newest message of each player
        self._leads = [0.0] * self._players
        self._waits = 0
        self._rollbacks = self._longest_rewind = 0
        self._desync: int | None = None

    @property
    def tick(self) -> int:
        """Number of the tick that `advance` makes next. The number equals the step count of the world."""
        return self._tick

    @property
    def confirmed(self) -> int:
        """First tick with an unknown input. No message can change earlier ticks."""
        return min(self._heard)

    @property
    def ahead(self) -> float:
        """Estimated number of ticks by which this machine is ahead of the slowest other machine; negative if
        this machine is behind.

        To avoid long rewinds on all machines, occasionally skip a tick while `ahead` is above 1.
        """
        return max(self._leads[each] for each in self._others)

    @property
    def desync(self) -> int | None:
        """First tick at whose start the states of two machines differ; None if all compared states agree."""
        return self._desync

    @property
    def rollbacks(self) -> int:
        """Number of rewinds that this session has made."""
        return self._rollbacks

    @property
    def longest_rewind(self) -> int:
        """Largest number of ticks of a single rewind."""
        return self._longest_rewind

    def advance(self, own_input: bytes) -> bool:
        """Correct wrong predictions, then make a tick.

        Args:
            own_input: input of the own player, `input_size` bytes. It takes effect `delay` ticks later.
        Returns: False if no tick was made, because `ticks` ticks are already predicted. Call `advance` again
            in the next frame, and keep sending messages.
        Raises: OptionError for an input of another size; SessionError after `patience` consecutive calls
            without a tick; errors of `act` and `World.step`, after which the tick is not made.
        """
        if not isinstance(own_input, bytes) or len(own_input) != self._input_size:
            raise OptionError(f"own_input must be {self._input_size} bytes, got {own_input!r}")
        self.settle()
        if self._tick - self.confirmed >= self._ticks:
            self._wait()
            return False
        self._waits = 0
        tick = self._heard[self._player]
        self._learn(self._player, own_input)
        try:
            self._make_tick()
        except BaseException:
            del self._inputs[self._player][tick]
            self._heard[self._player] = tick
            raise
        self._tick += 1
        self._forget()
        return True

    def settle(self) -> int:
        """Repeat the ticks with wrong predictions. `advance` calls this method first.

        Returns: number of repeated ticks.
        Raises: SessionError if other code stepped the world; errors of `act` and `World.step`. The next call
            continues with the tick that failed.
        """
        if self._wrong is not None:
            self._rollback.rewind_to(self._wrong)
            self._rollbacks += 1
            self._longest_rewind = max(self._longest_rewind, self._tick - self._wrong)
            self._wrong = None
        missing = self._tick - self._world.step_count
        if missing < 0:
            raise SessionError(
                f"the world made {-missing} steps outside its session: call only RollbackSession.advance"
            )
        while self._world.step_count < self._tick:
            self._make_tick()
        self._compare()
        return missing

    def message(self) -> bytes:
        """Return a datagram for all other machines. Send a datagram after each call of `advance`, even if the
        call returned False."""
        first, end = min(self._acknowledged[each] for each in self._others), self._heard[self._player]
        own = [self._inputs[self._player][tick] for tick in range(first, end)]
        # Leave out hashes of states that a rewind or a late input can still change.
        final = min(self.confirmed, self._tick if self._wrong is None else self._wrong)
        tick = max((each for each in self._hashes if each <= final), default=NO_TICK)
        settings = self._player, self._players, self._input_size, self._ticks, self._hash_every
        head = (MARK, self._start, *settings, self._tick, tick, self._hashes.get(tick, 0), first, len(own))
        return HEAD.pack(*head) + struct.pack(f"<{self._players}I", *self._heard) + b"".join(own)

    def receive(self, data: bytes) -> None:
        """Read a message from another machine. Messages can arrive late, repeatedly or out of order.

        The next call of `advance` or `settle` repeats the ticks that the message corrects.
        Args:
            data: result of `message` on the other machine.
        Raises: SessionError for a message that is damaged, belongs to another session, world or version, or
            contradicts an earlier message of its player. The error names the reason, and nothing is changed.
        """
        message = self._read(data)
        other = message.player
        for tick, each in enumerate(message.inputs, message.first):
            if tick >= self._heard[other]:
                self._learn(other, each)
                used = self._used.get(tick)
                if used is not None and used[other] != each:
                    self._wrong = tick if self._wrong is None else min(self._wrong, tick)
        heard = message.heard[self._player]
        self._acknowledged[other] = max(self._acknowledged[other], heard)
        if message.hash_tick != NO_TICK:
            self._their_hashes[message.hash_tick, other] = message.hash
        if message.tick > self._newest[other]:
            self._newest[other] = message.tick
            # Each machine receives the other machine's tick late. If the latency is equal in both directions,
            # half of the difference is the lead of this machine.
            lead = ((self._tick - message.tick) - (message.tick - (heard - self._delay))) / 2
            self._leads[other] += LEAD_SMOOTHING * (lead - self._leads[other])

    def _read(self, data: bytes) -> _Message:
        """Parse a message and check it. Raises: SessionError for an invalid message."""
        body = HEAD.size + 4 * self._players
        if not isinstance(data, (bytes, bytearray)) or len(data) < body or data[:4] != MARK:
            raise SessionError("these bytes are not a message of a session of this version")
        data = bytes(data)  # a copy, because the caller may reuse the buffer
        size = self._input_size
        parts: list[Any] = [*HEAD.unpack_from(data)]
        parts.append(struct.unpack_from(f"<{self._players}I", data, HEAD.size))
        parts.append([data[at : at + size] for at in range(body, len(data), size)])
        message = _Message(*parts)
        theirs = message.players, message.input_size, message.ticks, message.hash_every
        ours = self._players, self._input_size, self._ticks, self._hash_every
        if theirs != ours:
            names = "players, input_size, ticks, hash_every"
            raise SessionError(
                f"{names} are {theirs} there and {ours} here: use the same values on all machines"
            )
        if message.start != self._start:
            raise SessionError(
                f"the other world's initial state is {message.start:016x}, this one's is {self._start:016x}: "
                "run the same script, of the same version, on all machines"
            )
        if message.player not in self._others:
            raise SessionError(
                f"player {message.player} is not another player: this machine is player {self._player}"
            )
        if len(data) != body + size * message.input_count:
            raise SessionError(
                f"a message of {message.input_count} inputs has {len(data)} bytes: it is damaged"
            )
        self._require_order(message)
        return message

    def _require_order(self, message: _Message) -> None:
        """Check that a message agrees with earlier messages. Raises: SessionError if it does not."""
        who, known = f"player {message.player}", self._inputs[message.player]
        due = self._heard[message.player]
        if message.first > due:
            raise SessionError(
                f"{who} sends no input before tick {message.first}, and that of {due} is missing"
            )
        most = self._heard[self._player] + 2 * self._ticks  # a correct machine never sends later ticks
        hash_tick = -1 if message.hash_tick == NO_TICK else message.hash_tick
        if max(message.first + message.input_count, message.tick, hash_tick) > most:
            raise SessionError(
                f"{who} is beyond tick {most}, which no machine of this session can have reached"
            )
        if message.heard[self._player] > self._heard[self._player]:
            raise SessionError(f"{who} acknowledges an input that was not sent: the message is damaged")
        for tick, each in enumerate(message.inputs, message.first):
            if known.get(tick, each) != each:
                raise SessionError(f"{who} sends another input for tick {tick} than before")

    def _learn(self, player: int, value: bytes) -> None:
        """Store the next input of a player."""
        self._inputs[player][self._heard[player]] = value
        self._heard[player] += 1

    def _make_tick(self) -> None:
        """Save the state, apply known or predicted inputs, and make a step. After an error, nothing is
        changed.
        """
        tick = self._world.step_count
        self._rollback.save()
        if tick % self._hash_every == 0:
            self._hashes[tick] = int(self._world.bodies_hash(), 16)
        used = tuple(
            known[min(tick, heard - 1)] for known, heard in zip(self._inputs, self._heard, strict=True)
        )
        try:
            self._act(used)
            self._world.step(self._step.dt, self._step.substeps)
        except BaseException:
            self._rollback.rewind_to(tick)
            raise
        self._used[tick] = used

    def _wait(self) -> None:
        """Count a call of `advance` that made no tick. Raises: SessionError if there were too many."""
        self._waits += 1
        if self._waits >= self._patience:
            tick = self.confirmed
            silent = [str(each) for each in self._others if self._heard[each] == tick]
            raise SessionError(
                f"no input of player {' and '.join(silent)} for tick {tick} came in {self._waits} frames, "
                f"and {self._ticks} ticks are already predicted: end the session, or keep waiting"
            )

    def _compare(self) -> None:
        """Compare own and received hashes of states that late inputs cannot change."""
        for (tick, player), theirs in list(self._their_hashes.items()):
            if tick <= self.confirmed and tick in self._hashes:
                del self._their_hashes[tick, player]
                if theirs != self._hashes[tick]:
                    self._desync = tick if self._desync is None else min(self._desync, tick)

    def _forget(self) -> None:
        """Drop data that neither a rewind nor a message needs."""
        confirmed = self.confirmed
        for player, known in enumerate(self._inputs):
            needed = (
                min(self._acknowledged[each] for each in self._others)
                if player == self._player
                else confirmed
            )
            _drop_before(known, min(needed, confirmed) - 1)  # keep the last known input, for predictions
        _drop_before(self._used, confirmed)
        oldest = self._tick - 4 * self._ticks - self._delay - self._hash_every
        _drop_before(self._hashes, oldest)
        for key in [each for each in self._their_hashes if each[0] < oldest]:
            del self._their_hashes[key]


def _drop_before(rows: dict[int, bytes] | dict[int, Inputs] | dict[int, int], tick: int) -> None:
    """Delete the entries of ticks before `tick`."""
    for each in [each for each in rows if each < tick]:
        del rows[each]
