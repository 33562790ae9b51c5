"""Access control of a live world.

Requests must come from this machine or contain the token. Pages of other origins are refused.
"""

from __future__ import annotations

import hmac
import re
import secrets
import socket
import time
from dataclasses import dataclass
from http import HTTPStatus
from ipaddress import ip_address
from urllib.parse import parse_qs, urlsplit

MOST_VISITORS = 16

VIEW_KEY = "TAICHI_SOFT_VIEW_KEY"
"""Name of an environment variable. It contains a key that a program shares with the server that it starts."""

EVERYWHERE = ("0.0.0.0", "::")
"""Addresses that bind to all network interfaces."""

PUBLIC = (
    *("/live.css", "/live.js", "/view.js", "/room.js", "/panel.js", "/slider.js", "/plot.js"),
    *("/quantity.js", "/activities.js"),
    *(f"/three/{name}.js" for name in ("three.module", "three.core", "OrbitControls")),
)
"""Files of the page that do not need the token."""

MESSAGES, BURST = 240.0, 480.0
"""MESSAGES: largest message rate of a visitor [1/s]. BURST: largest number of messages that a visitor can
send at once. Dragging a body sends 60 messages per second."""

_HOST = re.compile(
    r"(?:\[(?P<address>[0-9A-Fa-f:.]+)\]|(?P<name>[A-Za-z0-9._-]+))(?::(?P<port>[0-9]{1,5}))?", re.ASCII
)

LARGEST_UPLOAD = 16 * 2**20
"""Largest mesh file of a visitor [bytes]."""

LARGEST_TEXT = 4096
"""Largest text message of a visitor [characters]."""


@dataclass(frozen=True)
class Guard:
    """Checks whether a request is allowed.

    Args:
        host: address to which the server is bound.
        port: port of the server.
        token: secret in the address that visitors open; None if `host` is a loopback address.
    """

    host: str
    port: int
    token: str | None

    @classmethod
    def of(cls, host: str, port: int) -> Guard:
        """Make a guard. It has a token unless `host` is a loopback address."""
        return cls(host, port, None if is_loopback(host) else secrets.token_urlsafe(16))

    def address(self) -> str:
        """Return the address for visitors to open."""
        name = socket.gethostname() if self.host in EVERYWHERE else self.host
        name = f"[{name}]" if ":" in name else name
        query = "" if self.token is None else f"?token={self.token}"
        return f"http://{name}:{self.port}/{query}"

    def refusal(self, path: str, host: str | None, origin: str | None) -> tuple[HTTPStatus, str] | None:
        """Return the HTTP status and the reason if a request is refused, or None if it is allowed.

        A page of another origin must not connect, even if DNS resolves its name to this machine (DNS
        rebinding). Therefore `Host` must name this server, and `Origin` must match `Host`. Files in `PUBLIC`
        need no token.
        Args:
            path: path and query of the request.
            host, origin: values of the headers `Host` and `Origin`, or None.
        """
        place = host_and_port(host)
        if place is None or (self.token is None and not self._is_mine(*place)):
            return HTTPStatus.FORBIDDEN, f"this world is served at {self.host}:{self.port}, not at {host!r}"
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return HTTPStatus.FORBIDDEN, f"pages of {origin!r} cannot connect to this world"
        if self.token is not None and urlsplit(path).path not in PUBLIC:
            given = parse_qs(urlsplit(path).query).get("token", [""])[0]
            if not hmac.compare_digest(given.encode(), self.token.encode()):
                return HTTPStatus.UNAUTHORIZED, "the token is missing or wrong: open the printed address"
        return None

    def _is_mine(self, name: str, port: int) -> bool:
        return is_loopback(name) and port == self.port


def host_and_port(host: str | None) -> tuple[str, int] | None:
    """Return the name and the port in a `Host` header, or None if the header is malformed.

    Browsers send a name or an address, and a port unless it is 80. Anything else, such as `user@name`, is
    malformed.
    """
    found = _HOST.fullmatch(host or "")
    if found is None:
        return None
    name, port = found["address"] or found["name"], found["port"]
    return name.lower(), 80 if port is None else int(port)


def is_loopback(host: str) -> bool:
    """True for an address that only this machine can reach."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


class Allowance:
    """Token bucket that limits the messages of a visitor, see `MESSAGES` and `BURST`."""

    def __init__(self) -> None:
        self._left, self._then = BURST, time.monotonic()

    def take(self) -> bool:
        """Use one message of the allowance. Returns: False if the visitor exceeds the limit."""
        now = time.monotonic()
        self._left = min(BURST, self._left + MESSAGES * (now - self._then))
        self._then = now
        self._left -= 1.0
        return self._left >= 0.0
