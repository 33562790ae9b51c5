"""Requests that wait for a world: the newest of each kind, and a share of the time for each visitor."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

SERVER = 0
"""Sender of the server's own messages: they come first, and are neither merged nor refused."""

MOST_WAITING = 64
"""Waiting requests of one visitor; further ones are refused."""

SHARE = 0.25
"""Largest fraction of the time that the requests of all visitors together take."""

BURST = 2.0
"""A visitor's time that is not used is kept for so long [s]: a few requests after a pause do not wait."""

LONGEST_WAIT = 1.0
"""Longest wait of a visitor's next request after an expensive one [s]."""

Message = tuple[Any, ...]


@dataclass
class _Sender:
    """The messages of one sender, by kind and segment. A segment ends with a message without a key."""

    waiting: OrderedDict[tuple[Hashable, int], Message] = field(default_factory=OrderedDict)
    segment: int = 0
    used_until: float = -math.inf  # time up to which its share is used [s]
    turn: int = 0  # when it was served last


class Inbox:
    """Messages of several senders, who take turns."""

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
            key: kind of the message. It replaces a waiting one of its kind, unless a message without a key
                lies between; None: it replaces nothing.
            is_kept: accept it however many wait.
            is_last: the sender leaves: drop what it has waiting.
        Returns: False if too many of this sender wait.
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
        """Return the next message and its sender, or None if every waiting one has to wait on.

        Args:
            now: the time [s]; without it nobody waits for a share of time.
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
        """Count the time that a visitor's request took, so that all visitors together keep to `SHARE`."""
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
