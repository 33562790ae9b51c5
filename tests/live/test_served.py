"""A live world through its protocol: what visitors can do, and what they cannot do."""

import contextlib
import http.client
import io
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
import zipfile
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np
import pytest
from visitor import Visitor
from websockets.exceptions import ConnectionClosed, InvalidStatus

from taichi_soft import box

pytestmark = pytest.mark.soak

FACTS = """
import json, runpy
made = runpy.run_path("scene.py")
world = made["world"]
m = world.bodies[0].material
print(json.dumps([m.young, m.poisson, m.damping_ratio, list(map(float, world.settings.gravity)),
    world.settings.friction, made["SUBSTEPS"], world.bodies[0].friction]))
"""


def script_of(visitor, folder):
    """Save the scene as a script, and put it into a folder."""
    before = len(visitor.made)
    visitor.say("save", what="script")
    offer = visitor.until(lambda: visitor.made[before:])[0]
    parts = urlsplit(visitor.address)
    with urlopen(f"http://{parts.netloc}{offer['made']}") as answer:
        content = io.BytesIO(answer.read())
    with zipfile.ZipFile(content) as archive:
        archive.extractall(folder)


def run_script(folder, *arguments):
    """Run a script, and return its output."""
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def closing_code(visitor, messages):
    """Return the code with which the server closes a connection that sends these messages."""
    try:
        for message in messages:
            visitor.socket.send(message)
        visitor.listen(20.0)
    except ConnectionClosed as closed:
        return None if closed.rcvd is None else closed.rcvd.code
    raise AssertionError("the connection is open")


def paused(visitor):
    """Pause the world, and wait until it reports the pause."""
    visitor.say("pause", is_paused=True)
    visitor.until(lambda: visitor.states[0]["is_paused"])


def test_bodies_fall_by_the_gravity_that_the_slider_says(visitor):
    for gravity in (3.0, 0.5):
        visitor.say("pause", is_paused=True)
        visitor.say("reset")
        visitor.say("set", name="gravity", value=gravity)
        visitor.until(lambda: visitor.states[0]["is_paused"] and visitor.pictures[0]["time"] <= 0.0)
        visitor.say("pause", is_paused=False)
        times, heights = [], []
        while not times or times[-1] < 0.35:
            visitor.hear()
            times.append(visitor.pictures[0]["time"])
            heights.append(visitor.body(5)[:, 2].mean())
        fit = np.polyfit(times, heights, 2)
        assert fit[0] == pytest.approx(-gravity / 2, rel=0.03)
    visitor.say("set", name="gravity", value=9.81)


def test_each_slider_gives_the_world_the_value_that_it_shows_and_the_script_keeps_it(visitor, tmp_path):
    given = {"young": 3e5, "poisson": 0.3, "damping": 0.4, "gravity": 2.5, "friction": 0.9, "substeps": 30}
    for name, value in given.items():
        visitor.say("set", name=name, value=value)
    visitor.until(lambda: all(visitor.states[0]["values"][name] == value for name, value in given.items()))
    script_of(visitor, tmp_path)
    young, poisson, damping, gravity, floor, substeps, body = json.loads(run_script(tmp_path, "-c", FACTS))
    assert (young, poisson, damping, substeps) == (3e5, 0.3, 0.4, 30)
    assert gravity == pytest.approx([0.0, 0.0, -2.5])
    assert (floor, body) == pytest.approx((0.9, 0.9))
    back = {"young": 1.5e5, "poisson": 0.4, "damping": 0.15, "gravity": 9.81, "friction": 0.5, "substeps": 8}
    for name, value in back.items():
        visitor.say("set", name=name, value=value)


@pytest.mark.guard
def test_a_saved_script_goes_on_as_the_world_does_to_the_bit(visitor, tmp_path):
    visitor.say("spawn", name="ring")
    visitor.until(lambda: visitor.states[0]["bodies"] == 7 and visitor.states[0]["time"] > 0.4)
    visitor.say("set", name="young", value=2e5)
    paused(visitor)
    script_of(visitor, tmp_path)
    start = visitor.states[0]["time"]
    for _ in range(60):
        visitor.say("step")
    dt = visitor.states[0]["dt"]
    visitor.until(lambda: visitor.states[0]["time"] > start + 59.5 * dt)
    assert visitor.states[0]["hash"] in run_script(tmp_path, "scene.py")
    visitor.say("set", name="young", value=1.5e5)


def test_a_body_is_grabbed_by_a_ray_follows_the_hand_and_flies_on_with_its_speed(visitor):
    visitor.say("reset")
    visitor.say("set", name="gravity", value=0.0)
    visitor.until(lambda: visitor.states[0]["time"] < 0.3)
    start = visitor.body(0).mean(axis=0)
    eye = np.array([start[0], start[1] - 5.0, start[2]])
    visitor.say("grab", origin=eye.tolist(), direction=[0.0, 1.0, 0.0])
    began, velocity = visitor.pictures[0]["time"], np.array([0.0, -0.8, 1.2])
    point = start - np.array([0.0, 0.3, 0.0])
    while visitor.pictures[0]["time"] < began + 1.2:
        visitor.say("move", point=(point + (visitor.pictures[0]["time"] - began) * velocity).tolist())
        visitor.hear()
    visitor.say("release")
    times, places = [], []
    end = visitor.pictures[0]["time"]
    while visitor.pictures[0]["time"] < end + 0.5:
        visitor.hear()
        if visitor.pictures[0]["time"] > end + 0.1:
            times.append(visitor.pictures[0]["time"])
            places.append(visitor.body(0).mean(axis=0))
    flown = np.polyfit(times, places, 1)[0]
    assert flown == pytest.approx(velocity, abs=0.15)
    visitor.say("set", name="gravity", value=9.81)


def test_who_leaves_lets_go_and_nobody_else_is_disturbed(visitor, served):
    with Visitor(served.address) as other:
        other.ready()
        start = other.body(0).mean(axis=0)
        other.say("grab", origin=[start[0], start[1], 9.0], direction=[0.0, 0.0, -1.0])
        other.say("move", point=[start[0], start[1], 3.0])
        visitor.until(lambda: visitor.body(0)[:, 2].mean() > 2.0)
    visitor.until(lambda: visitor.body(0)[:, 2].mean() < 1.0)
    before = visitor.counts["pictures"]
    visitor.until(lambda: visitor.counts["pictures"] > before + 10)


def test_who_comes_again_finds_the_world_where_it_is(visitor, served):
    visitor.until(lambda: visitor.states[0]["time"] > 0.5)
    with Visitor(served.address) as again:
        again.ready()
        assert again.states[0]["time"] > 0.4
        assert len(again.drawn[0][0]["bodies"]) == visitor.states[0]["bodies"]


def test_a_slow_visitor_gets_fewer_pictures_and_the_newest(visitor, served):
    with Visitor(served.address, is_slow=True) as slow:
        slow.until(lambda: slow.counts["pictures"] >= 2)
        last = slow.pictures[0]
        before = visitor.counts["pictures"]
        visitor.until(lambda: visitor.counts["pictures"] > before + 60)
        slow.listen(0.3)
        assert slow.pictures[0]["number"] == last["number"]  # no frame is waiting in between
        slow.say("seen", number=last["number"])
        slow.until(lambda: slow.pictures[0]["number"] > last["number"])
        assert slow.pictures[0]["time"] > last["time"] + 0.5
        assert abs(slow.pictures[0]["time"] - slow.states[0]["time"]) < 5.0


def test_a_visitor_that_stops_reading_stops_nobody(visitor, served):
    silent = Visitor(served.address, max_queue=1)
    try:
        for number in range(1, 2000):
            if number % 20 == 0:
                silent.say("seen", number=number)
                visitor.hear()
        before = visitor.counts["pictures"]
        visitor.until(lambda: visitor.counts["pictures"] > before + 60)
    finally:
        silent.end()


@pytest.mark.guard
def test_a_flood_of_messages_ends_its_connection_and_nothing_else(visitor, served):
    flood = Visitor(served.address)
    assert closing_code(flood, ['{"do": "step", "pane": 0, "x": "' + "y" * 200 + '"}'] * 3000) == 1008
    visitor.say("pause", is_paused=False)
    before = visitor.counts["pictures"]
    visitor.until(lambda: visitor.counts["pictures"] > before + 20)


def test_a_visitor_who_floods_the_world_with_allowed_requests_takes_no_frames_from_others(visitor, served):
    stop = threading.Event()
    cycle = itertools.cycle(
        [
            {"do": "set", "name": "young", "value": 2e5},
            {"do": "spawn", "name": "ball"},
            {"do": "set", "name": "poisson", "value": 0.3},
            {"do": "spawn", "name": "block"},
            {"do": "reset"},
            {"do": "tint", "quantity": "stress"},
        ]
    )

    def flood():
        with Visitor(served.address) as other:
            start, sent = time.monotonic(), 0
            while not stop.is_set():
                other.socket.send(json.dumps(next(cycle)))
                sent += 1
                while sent > 180 * (time.monotonic() - start):  # a second
                    with contextlib.suppress(TimeoutError):
                        other.hear(0.002)

    flooding = threading.Thread(target=flood)
    flooding.start()
    try:
        visitor.until(lambda: visitor.states[0]["bodies"] > 6)
        before = visitor.counts["pictures"]
        visitor.until(lambda: visitor.counts["pictures"] > before + 90, 30.0)
        lifted = visitor.body(0).mean(axis=0)
        visitor.say("grab", origin=[*lifted[:2], 9.0], direction=[0.0, 0.0, -1.0])  # is heard too
        visitor.say("save", what="script")
        visitor.until(lambda: visitor.made, 30.0)
    finally:
        stop.set()
        flooding.join()
    visitor.say("tint", quantity=None)


def test_reset_takes_back_all_sliders_or_goes_to_the_preset_that_was_chosen(visitor):
    scene = {name: visitor.states[0]["values"][name] for name in ("young", "poisson", "gravity", "friction")}
    for preset, wanted in (
        (None, scene),
        ("gelatine", {**scene, "young": 1e5, "poisson": 0.45, "damping": 0.08}),
        (None, scene),
    ):
        visitor.say("preset", name=preset)
        for name, value in {
            "young": 1e7,
            "poisson": -0.2,
            "gravity": 0.5,
            "friction": 0.1,
            "substeps": 90,
        }.items():
            visitor.say("set", name=name, value=value)
        visitor.until(lambda: visitor.states[0]["values"]["substeps"] == 90)
        visitor.say("reset")
        visitor.until(lambda wanted=wanted: wanted.items() <= visitor.states[0]["values"].items())
        assert visitor.states[0]["preset"] == preset
        assert visitor.states[0]["values"]["substeps"] < 20
        visitor.until(lambda: visitor.states[0]["time"] < 1.0)


def test_undo_goes_back_to_before_a_slider_a_preset_a_spawn_a_removal_and_a_reset(visitor):
    def state():
        shown = visitor.states[0]
        return shown["values"], shown["preset"], shown["bodies"], shown["hash"]

    visitor.until(lambda: visitor.states[0]["time"] > 0.2)
    paused(visitor)
    changes = [
        ("set", {"name": "young", "value": 1e6}, "Young's modulus"),
        ("preset", {"name": "foam"}, "Preset"),
        ("set", {"name": "gravity", "value": 1.0}, "Gravity"),
        ("spawn", {"name": "drum"}, "Add drum"),
        ("despawn", {}, "Remove last"),
        ("reset", {}, "Reset"),
    ]
    visitor.until(lambda: visitor.states[0]["hash"])
    before = [state()]
    for do, rest, words in changes:
        visitor.say(do, **rest)
        visitor.until(lambda words=words: visitor.states[0]["undo"] == words)
        changed = state()
        visitor.say("step")
        visitor.until(lambda changed=changed: state() != changed)
        before.append(state())
    # Each undo leads to the state that its change was made in.
    for (*_, words), wanted in zip(reversed(changes), reversed(before[:-1]), strict=True):
        assert visitor.states[0]["undo"] == words
        visitor.say("undo")
        visitor.until(lambda words=words: visitor.states[0]["undo"] != words)
        assert state() == wanted
    while visitor.states[0]["undo"]:
        last = visitor.states[0]
        visitor.say("undo")
        visitor.until(
            lambda last=last: (
                visitor.states[0]["undo"] != last["undo"] or visitor.states[0]["hash"] != last["hash"]
            )
        )
    visitor.say("undo")
    assert "no change" in visitor.until(lambda: visitor.refused)[0]
    visitor.say("pause", is_paused=False)


def test_a_drag_of_a_slider_is_undone_as_a_whole_and_a_body_that_was_held_is_free(visitor):
    visitor.until(lambda: visitor.states[0]["time"] > 0.2)
    start = visitor.body(0).mean(axis=0)
    visitor.say("grab", origin=[*start[:2], 9.0], direction=[0.0, 0.0, -1.0])
    visitor.say("move", point=[*start[:2], 2.5])
    visitor.until(lambda: visitor.body(0)[:, 2].mean() > 1.5)
    values = np.geomspace(1.6e5, 1e6, 30)
    for value in values:
        visitor.say("set", name="young", value=float(value))
        visitor.listen(0.02)
    visitor.until(lambda: visitor.states[0]["values"]["young"] == values[-1])
    visitor.say("undo")
    visitor.until(lambda: visitor.states[0]["values"]["young"] == 1.5e5)
    visitor.until(lambda: visitor.body(0)[:, 2].mean() < 1.0)


def test_odd_messages_are_refused_with_the_reason_and_nothing_changes(visitor):
    before = dict(visitor.states[0]["values"])
    for text in ("", "{", '{"do": "stop"}', '{"do": "set", "name": "young", "value": -1}', "x" * 50_000):
        count = len(visitor.refused)
        visitor.socket.send(text)
        visitor.until(lambda count=count: len(visitor.refused) > count)
    visitor.say("spawn", name="castle")
    visitor.until(lambda: any("castle" in words for words in visitor.refused))
    assert not any("castle" in words for words in visitor.said), "others do not hear of it"
    assert visitor.states[0]["values"] == before


def test_a_file_that_is_too_large_ends_its_connection_and_nothing_else(visitor, served):
    large = Visitor(served.address)
    large.say("upload", name="large.obj")
    assert closing_code(large, [bytes(17 * 2**20)]) in (None, 1009)  # or cut off while it sends
    before = visitor.counts["pictures"]
    visitor.until(lambda: visitor.counts["pictures"] > before + 20)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("notes.txt", b"hello", "wrong format"),
        ("scene.gltf", b"{}", "wrong format"),
        ("broken.obj", b"v 0 0\nf 1 2 3\n", "cannot be made into a body"),
        ("broken.glb", b"glTF" + bytes(40), "cannot be made into a body"),
        ("broken.stl", bytes(90), "cannot be made into a body"),
        ("empty.ply", b"", "bytes"),
    ],
)
def test_a_file_that_makes_no_body_is_refused_with_the_reason(visitor, name, content, reason):
    before = len(visitor.refused)
    visitor.say("upload", name=name)
    visitor.socket.send(content)
    words = visitor.until(lambda: visitor.refused[before:])[0]
    assert name in words
    assert reason in words


def test_a_file_without_a_name_is_refused(visitor):
    visitor.socket.send(b"v 0 0 0\n")
    assert "without its name" in visitor.until(lambda: visitor.refused)[0]


def test_a_visitors_mesh_becomes_a_body_whatever_its_name_says(visitor):
    mesh = box((0.4, 0.4, 0.4), (1, 1, 1))
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.surface]
    visitor.say("upload", name="../../etc/my crate.obj")
    visitor.socket.send("\n".join(lines).encode())
    visitor.until(lambda: "mycrate" in visitor.states[0]["palette"], 240.0)
    assert any("mycrate was added" in words for words in visitor.said)
    visitor.until(lambda: visitor.states[0]["bodies"] == 7)  # the body appears without a request
    visitor.say("spawn", name="mycrate")
    visitor.until(lambda: visitor.states[0]["bodies"] == 8)


def test_another_law_goes_on_where_the_bodies_are_and_stands_beside_the_first(visitor):
    visitor.until(lambda: visitor.states[0]["time"] > 0.7)
    paused(visitor)
    visitor.listen(0.5)
    before = [visitor.body(i).mean(axis=0) for i in range(6)]
    visitor.say("choose", law="st_venant_kirchhoff")
    visitor.until(lambda: visitor.chosen[0]["law"] == "st_venant_kirchhoff", 240.0)
    visitor.until(lambda: visitor.states[0]["time"] < 0.1)
    visitor.listen(0.5)
    after = [visitor.body(i).mean(axis=0) for i in range(6)]
    # A picture may be a step behind: at 2 m/s that is 33 mm. At the beginning bodies were 200 mm higher.
    assert np.abs(np.array(after) - before).max() < 0.035
    visitor.say("pause", is_paused=False)
    visitor.say("choose", law="springs", strain="exact")  # springs know no strain
    visitor.until(lambda: any("strain" in words and "springs" in words for words in visitor.said[-3:]))
    assert visitor.chosen[0]["law"] == "st_venant_kirchhoff"
    visitor.listen(1.2)  # a law was chosen just now
    visitor.say("compare", law=None)
    visitor.until(lambda: visitor.panes == [0, 1] and visitor.pictures.get(1), 240.0)
    assert visitor.chosen[1]["law"] is None
    visitor.say("alone")
    visitor.until(lambda: visitor.panes == [0])


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc to find the process")
def test_a_world_whose_process_dies_is_made_anew(visitor, served):
    children = Path(f"/proc/{served.process.pid}/task/{served.process.pid}/children").read_text().split()
    for child in children:
        command = Path(f"/proc/{child}/cmdline").read_bytes()
        if b"spawn_main" in command:
            os.kill(int(child), signal.SIGKILL)
    visitor.until(lambda: any("failed" in words for words in visitor.said))
    visitor.until(lambda: visitor.said[-1].endswith("is ready"), 240.0)
    before = visitor.counts["pictures"]
    visitor.until(lambda: visitor.counts["pictures"] > before + 5)


def test_pages_of_other_origins_are_refused(served):
    for options in ({"origin": "http://evil.example"}, {"additional_headers": {"Host": "evil.example"}}):
        with pytest.raises(InvalidStatus) as refused:
            Visitor(served.address, **options)
        assert refused.value.response.status_code in (400, 403)


@pytest.mark.parametrize(
    "path",
    ["/../server.py", "/%2e%2e/server.py", "/three/../../server.py", "//etc/passwd", "/made/", "/live.py"],
)
def test_only_files_of_the_page_are_served(served, path):
    parts = urlsplit(served.address)
    connection = http.client.HTTPConnection(parts.hostname, parts.port)
    connection.request("GET", path)
    assert connection.getresponse().status == 404
    connection.close()


def test_another_address_asks_for_its_token(serve):
    parts = urlsplit(serve("--host", "0.0.0.0").address)
    address = f"http://127.0.0.1:{parts.port}/"  # whatever this machine is called
    assert parts.query.startswith("token=")
    with pytest.raises(InvalidStatus) as refused:
        Visitor(address)
    assert refused.value.response.status_code == 401
    with Visitor(f"{address}?{parts.query}") as visitor:
        visitor.until(lambda: visitor.hello)


def test_a_scene_that_cannot_be_made_says_why_to_whoever_comes(serve, tmp_path):
    (tmp_path / "empty.py").write_text("x = 1\n")
    served = serve(str(tmp_path / "empty.py"))
    for _ in range(2):
        with Visitor(served.address) as visitor:
            visitor.until(lambda visitor=visitor: "one global World" in (visitor.status.get("trouble") or ""))


def test_a_step_that_raises_stops_the_world_and_says_why(serve, tmp_path):
    text = "from taichi_soft import Material, World, box\nworld = World(max_substeps=20)\n"
    text += "world.add_body(box((0.5, 0.5, 0.5), (2, 2, 2)), Material(1e5, 0.3, 500.0), position=(0, 0, 1))\n"
    (tmp_path / "strict.py").write_text(text)
    served = serve(str(tmp_path / "strict.py"))
    with Visitor(served.address) as visitor:
        visitor.ready()
        visitor.say("set", name="substeps", value=40)
        visitor.until(lambda: any("stopped" in words and "20" in words for words in visitor.said))
        visitor.until(lambda: visitor.states[0]["is_paused"])
        visitor.say("set", name="substeps", value=10)
        visitor.say("pause", is_paused=False)
        before = visitor.states[0]["time"]
        visitor.until(lambda: visitor.states[0]["time"] > before + 0.1)
