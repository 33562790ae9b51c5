"""The server while worlds come and go, with runners that belong to the test."""

import asyncio
import multiprocessing
import socket

import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft.core.errors import OptionError
from taichi_soft.live.audience import Visitor
from taichi_soft.live.controls import Given
from taichi_soft.live.requests import parse_request
from taichi_soft.live.scene import SceneSource
from taichi_soft.live.server import LiveServer


class Runner:
    """A world that accepts every request, unless it is busy."""

    def __init__(self, *, is_busy=False, source=None, state=None):
        self.is_over = self.is_killed = self.is_lost = self.is_asked = self.is_fresh = False
        self.keeps_sliders = False
        self.is_busy, self.requests = is_busy, []
        self.source, self.state = source or SceneSource(), state

    def send(self, *message, sender=0, key=None):
        self.requests.append(message)
        return not self.is_busy

    def stop(self):
        self.is_over = True

    def kill(self):
        self.is_over = self.is_killed = True


@pytest.fixture
def server():
    return LiveServer(SceneSource())


def obey(server, text):
    server.obey(Visitor(1, None), parse_request(text))


def said(server):
    """Messages that a visitor gets."""
    visitor = server.audience.visitors[1] = Visitor(1, None)
    return visitor.messages


FILM = '{"do": "save", "what": "film"}'


def test_a_film_whose_world_ends_before_it_is_given_keeps_nobody_from_the_next(server):
    first = server.worlds.panes[0] = Runner()
    obey(server, FILM)
    with pytest.raises(OptionError, match="a film is being rendered"):
        obey(server, FILM)
    first.stop()  # because another law replaces it
    second = server.worlds.panes[0] = Runner()
    obey(server, FILM)
    assert second.requests == [("film", 1)]


def test_a_film_that_a_busy_world_does_not_take_keeps_nobody_from_the_next(server):
    server.worlds.panes[0] = Runner(is_busy=True)
    with pytest.raises(OptionError, match="are waiting"):
        obey(server, FILM)
    server.worlds.panes[0].is_busy = False
    obey(server, FILM)
    assert server.worlds.panes[0].requests == [("film", 1)] * 2


def test_a_film_that_cannot_be_made_keeps_nobody_from_the_next(server):
    runner = server.worlds.panes[0] = Runner()
    obey(server, FILM)
    server.worlds.hear(0, runner, ("filmed", 1, ""))
    obey(server, FILM)
    assert len(runner.requests) == 2


def test_a_second_world_that_still_compiles_ends_at_once_where_one_alone_is_requested(server):
    server.worlds.panes[0], coming = Runner(), Runner()
    server.worlds.coming[1] = coming
    obey(server, '{"do": "alone"}')
    assert coming.is_killed
    assert not server.worlds.coming


def test_a_ninth_mesh_is_refused_and_nothing_is_read(server):
    source = SceneSource(meshes=tuple(f"{i}.obj" for i in range(8)))
    server.worlds.panes[0] = Runner(source=source)
    visitor = Visitor(1, None, upload="ninth.obj")
    with pytest.raises(OptionError, match="8 meshes"):
        server.take_upload(visitor, b"v 0 0 0")
    assert not server.is_reading


def test_a_request_to_a_second_world_says_that_there_is_none(server):
    server.worlds.panes[0] = Runner()
    with pytest.raises(OptionError, match="no second world"):
        obey(server, '{"do": "release", "pane": 1}')


def test_progress_is_shown_until_the_world_is_there_or_has_failed(server):
    worlds, audience = server.worlds, server.audience
    for end in ("ready", "failed"):
        runner = worlds.coming[0] = Runner(source=SceneSource(law="springs", meshes=("/a/duck.glb",)))
        steps = []
        for message in (("progress", "building", 0), *(("progress", "compiling", n) for n in (3, 69, 75))):
            worlds.hear(0, runner, message)
            (row,) = audience.status()["activities"]
            steps.append((row["title"], row["step"], row["done"], row["about"]))
        title = "playground, law springs"
        assert steps == [
            (title, "reading duck.glb, building bodies", 0, 0),
            (title, "compiling", 3, 70),
            (title, "compiling", 69, 70),
            (title, "compiling", 75, 0),  # more than usual: how many is not known
        ]
        messages = said(server)
        worlds.hear(0, runner, (end, "strain and springs"))
        assert audience.status()["activities"] == []
        assert ("strain and springs" if end == "failed" else "duck was added") in messages[-1]


def test_a_world_that_replaces_another_has_the_values_of_its_sliders_and_a_restarted_one_those_of_the_preset(
    server, monkeypatch
):
    state = {"given": {"young": 3e5, "gravity": 1.0}, "preset": "foam", "restarts": True}
    begun = []
    monkeypatch.setattr(
        "taichi_soft.live.worlds.Runner.started",
        lambda loop, folder, source, given, heard: begun.append(given) or Runner(source=source),
    )

    async def play():
        server.worlds.panes[0] = Runner(state=state)
        obey(server, '{"do": "choose", "law": "springs"}')
        server.worlds.reset(1)

    asyncio.run(play())
    assert begun == [
        Given(state["given"], "foam"),
        Given({"young": 1e6, "poisson": 0.3, "damping": 0.1}, "foam"),
    ]


def heads(host):
    """Send requests for the page and for a connection, with these lines of `Host`."""
    lines = "".join(f"Host: {each}\r\n" for each in host)
    upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    upgrade += "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    return {"page": f"GET / HTTP/1.1\r\n{lines}\r\n", "socket": f"GET /live HTTP/1.1\r\n{lines}{upgrade}\r\n"}


def status_of(port, head):
    """Return the status of the server's answer."""
    with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
        connection.sendall(head.encode("latin-1"))
        return int(connection.makefile("rb").readline().split()[1])


def test_page_and_socket_refuse_every_host_but_their_own():
    async def statuses():
        mine, theirs = multiprocessing.Pipe()
        server = LiveServer(SceneSource(), port=0, attached=mine)
        await server.open()
        port, found = server.port, {}
        hosts = {
            "own": [f"127.0.0.1:{port}"],
            "uppercase": [f"LOCALHOST:{port}"],
            "user": [f"evil@127.0.0.1:{port}"],
            "user and password": [f"evil:word@localhost:{port}"],
            "other name": [f"evil.example:{port}"],
            "other port": [f"127.0.0.1:{port + 1}"],
            "no port": ["127.0.0.1"],
            "two ports": [f"127.0.0.1:{port}:80"],
            "signed port": [f"127.0.0.1:+{port}"],
            "trailing dot": [f"localhost.:{port}"],
            "path": [f"127.0.0.1:{port}/"],
            "empty": [""],
            "missing": [],
            "twice": [f"127.0.0.1:{port}"] * 2,
            "twice, one other": [f"127.0.0.1:{port}", f"evil.example:{port}"],
        }
        for name, host in hosts.items():
            for kind, head in heads(host).items():
                found[name, kind] = await asyncio.to_thread(status_of, port, head)
        theirs.close()
        await server.close()
        return found

    found = asyncio.run(statuses())
    good = {(name, kind) for name in ("own", "uppercase") for kind in ("page", "socket")}
    assert {key for key, status in found.items() if status in (101, 200)} == good
    assert {status for key, status in found.items() if key not in good} == {403}
