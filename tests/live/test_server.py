"""What the server does between worlds that come and go, told by runners of the test's own."""

import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft.core.errors import OptionError
from taichi_soft.live.scene import SceneSource
from taichi_soft.live.server import LiveServer, Visitor
from taichi_soft.live.wishes import wish_of


class Runner:
    """A world that takes every wish, unless it is busy."""

    def __init__(self, *, is_busy=False):
        self.is_over = self.is_killed = False
        self.is_busy, self.wishes = is_busy, []

    def send(self, *message, key=None):
        self.wishes.append(message)
        return not self.is_busy

    def stop(self):
        self.is_over = True

    def kill(self):
        self.is_over = self.is_killed = True


@pytest.fixture
def server():
    return LiveServer(SceneSource())


def obey(server, text):
    server._obey(Visitor(1, None), wish_of(text))


FILM = '{"do": "save", "what": "film"}'


def test_a_film_whose_world_ends_before_it_is_given_keeps_nobody_from_the_next(server):
    first = server.panes[0] = Runner()
    obey(server, FILM)
    with pytest.raises(OptionError, match="a film is being drawn"):
        obey(server, FILM)
    first.stop()  # as another law takes its place
    second = server.panes[0] = Runner()
    obey(server, FILM)
    assert second.wishes == [("film", 1)]


def test_a_film_that_a_busy_world_does_not_take_keeps_nobody_from_the_next(server):
    server.panes[0] = Runner(is_busy=True)
    with pytest.raises(OptionError, match="busy"):
        obey(server, FILM)
    server.panes[0].is_busy = False
    obey(server, FILM)
    assert server.panes[0].wishes == [("film", 1)] * 2


def test_a_film_that_cannot_be_made_keeps_nobody_from_the_next(server):
    runner = server.panes[0] = Runner()
    obey(server, FILM)
    server.heard(0, runner, ("filmed", 1, ""))
    obey(server, FILM)
    assert len(runner.wishes) == 2


def test_a_second_world_that_still_compiles_ends_at_once_where_one_alone_is_wished(server):
    server.panes[0], coming = Runner(), Runner()
    server.coming[1] = coming
    obey(server, '{"do": "alone"}')
    assert coming.is_killed
    assert not server.coming


def test_a_ninth_mesh_is_refused_and_nothing_is_read(server):
    server.panes[0] = Runner()
    server.panes[0].source = SceneSource(meshes=tuple(f"{i}.obj" for i in range(8)))
    visitor = Visitor(1, None, upload="ninth.obj")
    with pytest.raises(OptionError, match="8 meshes"):
        server._take_upload(visitor, b"v 0 0 0")
    assert not server._is_reading


def test_what_is_wished_for_a_second_world_says_that_there_is_none(server):
    server.panes[0] = Runner()
    with pytest.raises(OptionError, match="no second world"):
        obey(server, '{"do": "release", "pane": 1}')
