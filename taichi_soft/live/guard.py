"""Who may see and touch a live world: this machine, or who has the token; no page of another origin."""

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
"""Name of the environment variable by which a server and the program that started it know each other."""

EVERYWHERE = ("0.0.0.0", "::")
"""Addresses that stand for all of a machine."""

PUBLIC = (
    *("/live.css", "/live.js", "/view.js", "/room.js", "/panel.js", "/slider.js", "/plot.js"),
    *("/quantity.js", "/activities.js"),
    *(f"/three/{name}.js" for name in ("three.module", "three.core", "OrbitControls")),
)
"""Files of the page."""

MESSAGES, BURST = 240.0, 480.0
"""Of one visitor: messages a second, and how many at once. A hand that is moved sends 60."""

_HOST = re.compile(
    r"(?:\[(?P<address>[0-9A-Fa-f:.]+)\]|(?P<name>[A-Za-z0-9._-]+))(?::(?P<port>[0-9]{1,5}))?", re.ASCII
)

LARGEST_UPLOAD = 16 * 2**20
"""Of a visitor's mesh file [bytes]."""

LARGEST_TEXT = 4096
"""Of any other message [bytes]."""


@dataclass(frozen=True)
class Guard:
    """What a request needs.

    Args:
        host: address that the server is bound to.
        port: and its port.
        token: part of the address that visitors are given; None on the loopback address.
    """

    host: str
    port: int
    token: str | None

    @classmethod
    def of(cls, host: str, port: int) -> Guard:
        """A token for any address but the loopback one."""
        return cls(host, port, None if is_loopback(host) else secrets.token_urlsafe(16))

    def address(self) -> str:
        """Which a visitor opens."""
        name = socket.gethostname() if self.host in EVERYWHERE else self.host
        name = f"[{name}]" if ":" in name else name
        query = "" if self.token is None else f"?token={self.token}"
        return f"http://{name}:{self.port}/{query}"

    def refusal(self, path: str, host: str | None, origin: str | None) -> tuple[HTTPStatus, str] | None:
        """Why a request is refused, or None. The page's scripts hold no secret, and ask for no token.

        A page of another origin may not open a connection, not even if a name server resolves its name to
        this machine. So `Host` must name this server, and `Origin` must agree with it.
        Args:
            path: with its query.
            host, origin: headers of those names.
        """
        place = host_and_port(host)
        if place is None or (self.token is None and not self._is_mine(*place)):
            return HTTPStatus.FORBIDDEN, f"this world is served for {self.host}:{self.port}, not for {host!r}"
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            return HTTPStatus.FORBIDDEN, f"a page of {origin!r} may not touch this world"
        if self.token is not None and urlsplit(path).path not in PUBLIC:
            given = parse_qs(urlsplit(path).query).get("token", [""])[0]
            if not hmac.compare_digest(given.encode(), self.token.encode()):
                return HTTPStatus.UNAUTHORIZED, "this address needs its token: open the one that was printed"
        return None

    def _is_mine(self, name: str, port: int) -> bool:
        return is_loopback(name) and port == self.port


def host_and_port(host: str | None) -> tuple[str, int] | None:
    """Return the name and port in a `Host` header, port 80 if it has none; None if the header is malformed.

    A browser sends a bare name or address and a port. Anything else, such as `user@name`, is malformed.
    """
    found = _HOST.fullmatch(host or "")
    if found is None:
        return None
    name, port = found["address"] or found["name"], found["port"]
    return name.lower(), 80 if port is None else int(port)


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


class Allowance:
    """How many messages a visitor may still send: so many at once, and so many a second."""

    def __init__(self) -> None:
        self._left, self._then = BURST, time.monotonic()

    def take(self) -> bool:
        """One message. Returns: False where it is one too many."""
        now = time.monotonic()
        self._left = min(BURST, self._left + MESSAGES * (now - self._then))
        self._then = now
        self._left -= 1.0
        return self._left >= 0.0
