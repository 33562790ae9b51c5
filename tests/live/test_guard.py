"""Access to a live world: from this machine or with the token, and never from a page of another origin."""

import time

import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft.live.guard import BURST, MESSAGES, Allowance, Guard

MALFORMED = (
    *("evil@127.0.0.1:8080", "evil:word@127.0.0.1:8080", "@127.0.0.1:8080", "evil%40127.0.0.1:8080"),
    *("127.0.0.1:port", "127.0.0.1:8080:80", "127.0.0.1:80:8080", "127.0.0.1:+8080", "127.0.0.1:-8080"),
    *("127.0.0.1:8080, 127.0.0.1:8080", "127.0.0.1:8080, evil.example:8080", "127.0.0.1:\u0668080"),
    *("127.0.0.1.:8080", "localhost.:8080", "127.0.0.1:8080.", "127.0.0.1", "127.0.0.1:", ":8080"),
    *("127.0.0.1:8080/", "127.0.0.1:8080?x", "127.0.0.1:8080#x", "http://127.0.0.1:8080", "127.1:8080"),
    *(" 127.0.0.1:8080", "127.0.0.1:8080\n", "127.0.0.1 :8080", "[::1:8080", "::1:8080", "[", "0:8080"),
    *("[::ffff:1.2.3.4]:8080", "[::1%25eth0]:8080", "\uff11\uff12\uff17.0.0.1:8080", "127.0.0.1:08080080"),
)
"""Values of a `Host` header that no browser sends for a page of this machine."""


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        ("127.0.0.1:8080", None),
        ("localhost:8080", "http://localhost:8080"),
        ("[::1]:8080", "http://[::1]:8080"),
        ("127.0.0.1:8080", "http://127.0.0.1:8080"),
        ("LocalHost:8080", None),
    ],
)
def test_this_machine_needs_no_token(host, origin):
    guard = Guard.of("127.0.0.1", 8080)
    assert guard.token is None
    assert guard.refusal("/live", host, origin) is None


@pytest.mark.parametrize(
    ("host", "origin"),
    [
        (None, None),
        ("", None),
        ("evil.example:8080", "http://evil.example:8080"),  # a name that was redirected to this machine
        ("127.0.0.1:8080", "http://evil.example"),
        ("127.0.0.1:8080", "http://127.0.0.1:9999"),
        ("127.0.0.1:8080", "null"),
        ("127.0.0.1:9999", None),
        *((host, None) for host in MALFORMED),
        *((f"evil.example@{host}", None) for host in ("localhost:8080", "[::1]:8080")),
    ],
)
def test_pages_of_other_origins_and_names_are_refused(host, origin):
    assert Guard.of("127.0.0.1", 8080).refusal("/live", host, origin) is not None


def test_any_other_address_asks_for_its_token_which_is_new_every_time():
    guard = Guard.of("0.0.0.0", 8080)
    assert guard.token != Guard.of("0.0.0.0", 8080).token
    assert len(guard.token) >= 20
    assert guard.token in guard.address()
    assert guard.refusal(f"/live?token={guard.token}", "box.local:8080", "http://box.local:8080") is None
    for path in ("/live", "/", "/live?token=", f"/live?token={guard.token}x", "/live?token=%00%ff"):
        status, words = guard.refusal(path, "box.local:8080", None)
        assert status == 401
        assert guard.token not in words
    assert guard.refusal(f"/live?token={guard.token}", "box.local:8080", "http://evil.example")[0] == 403
    for host in (None, "evil@box.local:8080", "box.local:8080, evil.example"):
        assert guard.refusal(f"/live?token={guard.token}", host, None)[0] == 403
    assert guard.refusal("/live.js", "box.local:8080", None) is None  # a file that the page requests
    assert "0.0.0.0" not in guard.address()


def test_a_flood_of_messages_is_over_after_a_burst_and_an_allowance_comes_back(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    allowance = Allowance()
    assert sum(allowance.take() for _ in range(int(BURST) + 50)) == BURST
    now[0] += 1.0
    assert 0 < sum(allowance.take() for _ in range(int(BURST))) <= MESSAGES
