"""Queue of requests to a world.

The queue keeps the newest request of each kind, and limits the time that each visitor's requests take.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

SERVER = 0
"""Sender number of the server. Messages of the server are served first, and never merged or refused."""

MOST_WAITING = 64
"""Largest number of queued requests of one visitor; further requests are refused."""

SHARE = 0.25
"""Largest fraction of time that a world spends on the requests of all visitors together."""

BURST = 2.0
"""Longest time by which a visitor can use allowed time in advance [s]. Short bursts of requests therefore do
not wait."""

LONGEST_WAIT = 1.0
"""Longest time that a visitor's next request waits after an expensive request [s]."""

Message = tuple[Any, ...]


@dataclass
class _Sender:
    """Messages of one sender, by kind and segment. A message without a key begins a new segment."""

    waiting: OrderedDict[tuple[Hashable, int], Message] = field(default_factory=OrderedDict)
    segment: int = 0
    used_until: float = -math.inf  # time until which the sender has used all allowed time [s]
    turn: int = 0  # number of the last turn of this sender


class Inbox:
    """Messages of several senders, served in turn."""

    def __init__(self) -> None:
        self._senders: dict[int, _Sender] = {}
        self._turn = 0

    def __len__(self) -> int:
        return sum(len(each.waiting) for each in self._senders.values())

    def put(
        self,
        sender: int,
        message: Message,
        key: Hashable = None,
        *,
        is_kept: bool = False,
        is_last: bool = False,
    ) -> bool:
        """Add a message.

        Args:
            key: kind of the message. The message replaces a queued message of the same kind, unless a message
                without a key was added between the two. None replaces no message.
            is_kept: True to accept the message even if the queue is full.
            is_last: True if the sender leaves, to drop all earlier messages of the sender.
        Returns: False if too many messages of this sender are queued.
        """
        mine = self._senders.setdefault(sender, _Sender())
        if is_last:
            mine.waiting.clear()
        if key is None or sender == SERVER:
            mine.segment += 1
        place = key, mine.segment
        mine.waiting.pop(place, None)
        if len(mine.waiting) >= MOST_WAITING and sender != SERVER and not is_kept:
            return False
        mine.waiting[place] = message
        return True

    def take(self, now: float = math.inf) -> tuple[int, Message] | None:
        """Remove the message to serve next. Returns: its sender and the message, or None if nothing is ready.

        Args:
            now: current time [s]; by default, time limits are ignored.
        """
        ready = [
            (sender != SERVER, each.turn, sender)
            for sender, each in self._senders.items()
            if each.waiting and each.used_until <= now + BURST
        ]
        if not ready:
            return None
        sender = min(ready)[2]
        self._turn += 1
        self._senders[sender].turn = self._turn
        return sender, self._senders[sender].waiting.popitem(last=False)[1]

    def charge(self, sender: int, now: float, seconds: float) -> None:
        """Charge a visitor for the time that a request took, so that all visitors together do not exceed
        `SHARE`.

        Args:
            now: current time [s].
            seconds: duration of the request [s].
        """
        if sender == SERVER:
            return
        mine = self._senders.setdefault(sender, _Sender())
        self._senders = {
            number: each
            for number, each in self._senders.items()
            if each.waiting or each.used_until > now or each is mine
        }
        sharing = len(self._senders.keys() - {SERVER})
        used = max(mine.used_until, now) + seconds * sharing / SHARE
        mine.used_until = min(used, now + BURST + LONGEST_WAIT)

    def clear(self) -> None:
        """Drop all messages."""
        self._senders.clear()
