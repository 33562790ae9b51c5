"""A visitor without a browser: messages of a page, sent and decoded by separate code."""

import json
import struct
import time
from contextlib import ExitStack
from urllib.parse import urlsplit

import numpy as np
from websockets.sync.client import connect


def decoded_picture(packet):
    """A picture packet as a dict: positions (n, 3) [m] in float64, and the rest of it."""
    kind, pane, is_tinted, number, version, count, moment = struct.unpack_from("<BBHIIId", packet)
    low, size = np.frombuffer(packet, "<f4", 3, 24), np.frombuffer(packet, "<f4", 3, 36)
    poses_end = len(packet) - 10 * count
    rows = np.frombuffer(packet, "<u2", 3 * count, poses_end + 4 * count).reshape(-1, 3)
    normals = np.frombuffer(packet, "i1", 4 * count, poses_end).reshape(-1, 4)
    assert kind == 2
    return {
        "pane": pane,
        "is_tinted": bool(is_tinted),
        "number": number,
        "version": version,
        "time": moment,
        "poses": np.frombuffer(packet[48:poses_end], "<f4").reshape(-1, 12),
        "normals": normals[:, :3] / 127.0,
        "tints": normals[:, 3],
        "positions": low.astype(float) + size.astype(float) * rows / 65535,
        "quantum": size.astype(float) / 65535,
    }


def decoded_drawn(packet):
    """Decode a drawn frame. Returns: its pane, header and arrays."""
    kind, pane, _, length = struct.unpack_from("<BBHI", packet)
    assert kind == 1
    header, at, arrays = json.loads(packet[8 : 8 + length]), 8 + length, {}
    for name, (dtype, shape) in header["arrays"].items():
        count = int(np.prod(shape))
        arrays[name] = np.frombuffer(packet, np.dtype(dtype).newbyteorder("<"), count, at).reshape(shape)
        at += -(-count * np.dtype(dtype).itemsize // 4) * 4
    return pane, header, arrays


class Visitor:
    """A visitor that acknowledges every frame, unless it is slow."""

    def __init__(self, address, *, is_slow=False, **options):
        parts = urlsplit(address)
        query = f"?{parts.query}" if parts.query else ""
        self.address, self._open = address, ExitStack()
        place = f"ws://{parts.netloc}/live{query}"
        options = {"max_size": None, "compression": None, "close_timeout": 1.0, **options}
        self.socket = self._open.enter_context(connect(place, **options))
        self.is_slow = is_slow
        self.states, self.drawn, self.pictures, self.panes, self.chosen = {}, {}, {}, [], {}
        self.said, self.refused, self.made = [], [], []
        self.hello, self.status = None, {}
        self.counts = {"pictures": 0, "bytes": 0}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def end(self):
        """Close the page."""
        self._open.close()

    def say(self, do, **rest):
        """Send a request."""
        self.socket.send(json.dumps({"do": do, **rest}))

    def hear(self, timeout=60.0):
        """Receive one message."""
        message = self.socket.recv(timeout=timeout)
        if isinstance(message, str):
            self._take_words(json.loads(message))
        elif message[0] == 1:
            pane, header, arrays = decoded_drawn(message)
            self.drawn[pane] = header, arrays
        else:
            picture = decoded_picture(message)
            self.pictures[picture["pane"]] = picture
            self.counts["pictures"] += 1
            if not self.is_slow:
                self.say("seen", number=picture["number"])
        self.counts["bytes"] += len(message)
        return message

    def _take_words(self, words):
        if "hello" in words:
            self.hello = words
        elif "state" in words:
            self.states[words["pane"]] = words["state"]
            self.chosen[words["pane"]] = words["chosen"]
        elif "panes" in words:
            self.panes = words["panes"]
        elif "status" in words:
            self.status = words["status"]
        for name in ("said", "refused", "made"):
            if name in words:
                getattr(self, name).append(words if name == "made" else words[name])

    def until(self, found, timeout=90.0):
        """Listen until something is true, and return it."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            value = found()
            if value:
                return value
            try:
                self.hear(0.5)
            except TimeoutError:
                continue
        raise AssertionError(
            f"nothing of the kind in {timeout:g} s; said: {self.said}, refused: {self.refused}"
        )

    def listen(self, seconds):
        """Receive messages for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                self.hear(max(end - time.monotonic(), 0.01))
            except TimeoutError:
                return

    def ready(self):
        """Wait for a world and a picture of it."""
        return self.until(lambda: self.states.get(0) and self.pictures.get(0), 300.0)

    def body(self, number, pane=0):
        """Vertices of a body in the last picture, (n, 3) [m]."""
        row = self.drawn[pane][0]["bodies"][number]
        return self.pictures[pane]["positions"][row["first"] : row["first"] + row["count"]]
