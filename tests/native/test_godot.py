"""Godot 3 plays the demo without a window: motion, drawn meshes, agreement with C bit by bit, and errors."""

import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from games import line, lines_of
from godot_build import GODOT, SCRIPTS, files_of, told
from godot_games import HALF_TURN, UPRIGHT, levels_game
from native_build import ROOT

pytestmark = [pytest.mark.soak, pytest.mark.guard]

DT = 1 / 64


@pytest.fixture(scope="module")
def project(engine, libraries, demo_world, tmp_path_factory):
    """The demo as a reader has it after the steps of docs/godot.md, and the scripts of this test."""
    folder = tmp_path_factory.mktemp("project") / "demo"
    subprocess.run([sys.executable, str(GODOT / "write_project.py"), "3", str(folder)], check=True)
    shutil.copytree(libraries, folder / "addons" / "taichi_soft" / "bin")
    for script in SCRIPTS.glob("*.gd"):
        shutil.copy(script, folder)
    shutil.copytree(demo_world, folder / "demo.softworld")
    return folder


@pytest.fixture(scope="module")
def run(engine, project):
    """A function that runs a script in Godot; returns all it printed."""

    def printed(script):
        command = [engine, "--path", str(project), "--fixed-fps", "60", "-s", script]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "SCRIPT ERROR" not in done.stdout + done.stderr, done.stderr
        return done.stdout

    return printed


@pytest.fixture(scope="module")
def world_of(project, export):
    """A function that copies a world of scenes.py into the project, once, and returns its folder."""

    def folder(name):
        found = project / f"{name}.softworld"
        return found if found.exists() else shutil.copytree(export(name), found)

    return folder


@pytest.fixture(scope="module")
def scene(run):
    return told(run("scene.gd"))


@pytest.fixture(scope="module")
def rows(scene):
    """Return the measurements in each frame of the scene."""
    _, *found = scene["scene"]["rows"]
    return {name: np.array([row[name] for row in found]) for name in found[0]}


def test_a_platform_carries_a_body(rows):
    """The platform moves by 0.6 m, and the body on it moves with it."""
    moved = np.ptp(rows["platform"][:, 2])
    assert moved == pytest.approx(0.6, abs=0.01)
    on_it = rows["rider"][120:] - rows["platform"][120:]
    assert np.ptp(on_it[:, 2]) < 0.15 * moved
    assert (on_it[:, 1] > 0.1).all()  # its surface; the elephant's middle is some 0.2 m higher


def test_a_rigid_crate_lies_on_a_soft_block_and_sinks_in(scene, rows):
    crate = rows["crate"][240:]
    assert np.ptp(crate, axis=0).max() < 0.005  # it lies still, because neither body gains energy
    bottom, top = crate[:, 1].mean() - 0.2, scene["meshes"]["Block"]["top"]
    assert 0.002 < top - bottom < 0.05


def test_the_block_bears_the_weight_of_the_crate(rows):
    """Mean force of the soft block over three seconds is 100 kg times gravity."""
    force = rows["push"][240:, 1].mean() * 60
    assert force == pytest.approx(100 * 9.8, rel=0.01)


def test_a_capsule_lies_along_z_as_in_godot(rows):
    """A body that falls next to the capsule's middle, but above its end, hits it."""
    assert rows["capsule"].max() > 1.0


def test_drawn_meshes_are_those_of_the_library(scene):
    meshes = scene["meshes"]
    assert [mesh["equal"] for mesh in meshes.values()] == [True, True]
    assert meshes["Rider"]["uvs"] == meshes["Rider"]["vertices"] > 8000
    assert meshes["Block"]["volume"] == pytest.approx(0.5, rel=0.02)  # fronts are outside
    assert meshes["Rider"]["volume"] > 0.0
    assert meshes["Block"]["center"] == pytest.approx([1.5, 0.25, 0.0], abs=0.02)


def test_a_snapshot_rewinds(scene):
    rewind = scene["rewind"]
    before, after, again, after_again = rewind["hashes"]
    assert rewind["taken"]
    assert (before, after) == (again, after_again)
    assert before != after


def test_signals_arrive(scene):
    assert scene["sleep"] == {"slept": True, "woke": True}
    assert scene["scene"]["froze"] > 0


@pytest.fixture(scope="module")
def hands(run):
    """Return the state of an elephant and a block while they are lifted, queried and attached."""
    return told(run("hands.gd"))


def kinds(events, who):
    return [event[0] for event in events if event[1] == who]


def test_a_contact_tells_the_node_and_the_impulse(hands):
    events = hands["fallen"]["told"]
    assert kinds(events, "block") == ["began", "slept"]
    assert kinds(events, "rider")[:2] == ["began", "ended"]  # it jumps before it lies
    for kind, _, *rest in events:
        if kind == "began":
            collider, node, impulse = rest
            assert (collider, node) == (0, "Ground")
            assert impulse[1] < 0.0  # it pushes down


def test_a_contact_ends_when_a_body_is_lifted(hands):
    """The impulse over the whole contact is the weight times its duration."""
    lift = hands["lift"]
    ended = [event for event in lift["told"] if event[0] == "ended"]
    ((_, who, _, node, impulse, duration),) = ended
    assert (who, node) == ("rider", "Ground")
    assert -impulse[1] == pytest.approx(lift["mass"] * 9.81 * duration, rel=0.05)


def test_a_grabbed_body_follows_the_hand(hands):
    """It follows to 2 cm, and the force is its weight. The other body stays in place."""
    lift = hands["lift"]
    assert lift["is_rider"]
    assert lift["from_point"] < 1e-5
    assert abs(lift["height"]) < 1e-5
    assert lift["from_hand"] < 0.02
    assert lift["block_moved"] == 0.0
    assert lift["force"] == pytest.approx([0.0, lift["mass"] * 9.81, 0.0], abs=0.01 * lift["mass"] * 9.81)
    assert lift["released"] == [True, False, False]
    assert kinds(lift["after"], "rider")[:2] == ["woke", "began"]


def test_overlaps_find_bodies_where_they_are(hands):
    found = hands["overlaps"]
    assert found["sphere"] == [["rider"], ["block"]]
    assert found["all"] == ["rider", "block"]
    assert found["none"] == []
    assert found["box"] == [["block"], [], []]
    assert (found["ray"], found["up"]) == (0, 0)  # too far, and away from it


def test_who_sleeps_and_wakes_is_told(hands):
    assert hands["sleep"] == {"woke": [["woke", "block"]], "slept": [["slept", "block"]]}


def test_a_body_follows_a_frame_until_it_is_let_go(hands):
    hang = hands["hang"]
    assert hang["attached"]
    assert hang["pose"] == pytest.approx([0.0, 0.6, -0.3], abs=1e-5)
    assert hang["moved"] == pytest.approx(hang["pose"], abs=0.02)
    weight = hands["lift"]["mass"] * 9.81
    assert hang["load"] == pytest.approx([0.0, -weight, 0.0], abs=0.01 * weight)
    assert "ended" in kinds(hang["told"], "rider")
    assert hang["removed"] == [True, False]
    assert abs(hang["fell"]) < 0.1  # of the 0.6 m that it was lifted, in whichever pose it lands
    assert "began" in kinds(hang["after"], "rider")
    assert hang["held"] - hang["fell"] == pytest.approx(0.2, abs=0.03)
    assert hang["detached"] == [True, False]
    assert abs(hang["fell_again"]) < 0.1


def test_soft_bodies_that_meet_are_told(hands):
    meet = hands["meet"]
    met = [event[:3] for event in meet["met"] if event[0] == "met"]
    assert met[0] == ["met", "other", "block"]
    ((kind, *who, impulse, duration),) = meet["parted"]  # when one body is removed
    assert [kind, *who] == ["parted", "other", "block"]
    assert impulse[1] < 0.0 < duration


def test_a_contact_that_ends_tells_the_node_that_there_was(hands):
    """Its collider's number belongs to another one already, which has no node."""
    taken = hands["taken"]
    assert (taken["removed"], taken["number"]) == (True, 0)
    assert {(kind, who, number, node) for kind, who, number, node, *_ in taken["told"]} == {
        ("ended", "rider", 0, "Ground"),
        ("ended", "block", 0, "Ground"),
    }
    assert taken["later"][0][:4] == ["began", "block", 0, ""]


def test_only_what_is_listened_to_is_recorded(hands):
    assert hands["unheard"] == {"recorded": 0, "events": 0}
    assert hands["heard"] == {"recorded": 2 | 8}


def test_the_mouse_of_the_demo_pulls_an_elephant(run):
    found = told(run("mouse.gd"))["mouse"]
    assert found["hand"]
    assert found["held"] > found["before"] + 0.5
    assert found["held"] == pytest.approx(found["place"], abs=0.3)  # it hangs below the hand
    assert found["after"] == pytest.approx(found["before"], abs=0.2)  # it can land on its side
    assert not found["sky"]


HELD = {  # by step
    10: [
        line("add_frame", (0.5, 1.0, 0.25), UPRIGHT),
        line("grab", 3, 5, (0.5, 0.25, 0.25), (1.5, 1.5, 0.0), 4.0, -1.0),
    ],
    50: [line("move_grab", 0, (1.25, 1.25, 0.5)), line("attach", 0, [3, 1, 12], 0, 1)],
    70: [line("grab_force", 0), line("load", 0, 0), line("release_grab", 0)],
    80: [line("move_frame", 0, (0.5, 1.125, 0.25), UPRIGHT)],
    90: [
        line("gravity", (0.5, -9.5, 0.25)),
        line("body_friction", 3, 0.25),
        line("collider_friction", 0, 0.125),
        line("join", 0, [3, 1], 3, [5, 7]),
        line("add_motor", 3, [0, 1, 2, 9], 1, 0, 0, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0), 2.0, 8.0),
    ],
    140: [
        line("motor_speed", 0, -4.0),
        line("joint_force", 0),
        line("motor_state", 0),
        line("release_joint", 0),
    ],
    155: [line("motor_limit", 0, 2.0)],
    180: [line("remove_motor", 0)],
    150: [line("detach", 0, [1]), line("grab", 0, 7, (0.0, 1.0, 0.0), (-1.5, 2.0, 0.0), 8.0, 64.0)],
    210: [line("add_frame", (0.0, 1.0, 0.0), UPRIGHT), line("remove_frame", 1), line("detach", 0, [])],
}


def game():
    """Calls in numbers that Godot's 32 bits hold exactly."""
    yield line("add_collider", 0, (0, 0, 0), 0.5, -1.0, 0.0, 1, -1, (0.0, 0.0, 0.0), UPRIGHT)
    yield line("add_collider", 2, (2.0, 0.25, 2.0), 0.875, -1.0, 0.0, 1, -1, (-1.5, 0.25, 0.0), UPRIGHT)
    yield line("record_events", 31)
    for i in range(240):
        if i in HELD:
            yield from HELD[i]
        if i < 160:
            yield line("move_collider", 1, (-1.5 + i / 512, 0.25 + (i % 32) / 1024, 0.0), UPRIGHT)
        if i == 40:
            yield line("spawn", 0, (1.5, 0.75, 0.125), HALF_TURN, (0.0, -1.0, 0.25), (0.0, 2.0, 0.0))
            yield line("velocity", 3, (0.5, 1.0, 0.0), (0.0, 0.0, 1.0))
        if i == 100:
            yield line("snapshot")
        if i == 130:
            yield line("restore")
        if i == 200:
            yield line("despawn", 1)
        yield line("step", DT, 0)
        if i % 60 == 59:
            yield line("status", 3)
            yield line("mesh", 0, 0)
            yield line("mesh", 3, 1)
            yield line("drain")
            yield line("overlap_sphere", (1.5, 0.25, 0.0), 0.25)
            yield line("overlap_box", (-1.5, 0.5, 0.0), HALF_TURN, (0.5, 0.25, 4.0))


@pytest.mark.parametrize(("world", "game"), [("demo", game), ("levels", levels_game)])
def test_a_game_in_godot_has_the_same_bits(world, game, run, project, world_of, play):
    calls, folder = list(game()), world_of(world)
    (project / "game.txt").write_text("\n".join([f"world {folder.name}", *calls]), encoding="utf-8")
    found = [row[5:] for row in run("play.gd").splitlines() if row.startswith("PLAY ")]
    assert len(set(found)) > 240
    assert found == lines_of([play, folder], calls)


@pytest.fixture(scope="module")
def levels(run, project, world_of):
    """Printed state of bodies with levels of detail, and of their drawn meshes."""
    world_of("levels")
    text = (ROOT / "docs" / "godot.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"^```gdscript\n(# Coarser.*?)^```", text, re.DOTALL | re.MULTILINE)
    (project / "page_levels.gd").write_text(f"extends Spatial\n\nvar world\n\n{script}", encoding="utf-8")
    return told(run("levels.gd"))


BARS = ((8, 3, 2), (5, 2, 2), (3, 1, 1))
"""Cells of a bar at each level, as tests/native/scenes.py has them."""


def surface_of(level):
    """Vertices of a bar, those on its surface, and its triangles: a cell has two on each outer side."""
    x, y, z = BARS[level]
    own, inside = (x + 1) * (y + 1) * (z + 1), (x - 1) * (y - 1) * (z - 1)
    return {"own": own, "places": own - inside, "triangles": 4 * (x * y + y * z + z * x)}


def require_level(drawn, level):
    """The mesh is that of a bar at this level, and its vertices are where the bar has its own."""
    assert drawn["level"] == level
    assert surface_of(level).items() <= drawn.items()
    assert drawn["normals"]
    assert drawn["apart"] < 1e-6
    assert drawn["volume"] == pytest.approx(0.9 * 0.3 * 0.2, rel=0.1)  # fronts are outside


def test_a_body_without_a_skin_is_drawn_by_the_mesh_of_its_level(levels):
    assert levels["counts"] == [3, 3, 0]
    assert levels["levels"] == [0, 1, -1]
    assert levels["early"] == [False, -1, 0]  # the world has not started
    for number, found in enumerate(levels["drawn"]):
        level = (0, 2, 1, 1, 0, 2)[number // 2]
        assert all(found["answers"])
        require_level(found["bar"], level)
        require_level(found["named"], level)  # its node names the mesh of level 1


def test_a_skin_keeps_its_vertices_at_every_level(levels):
    balls = [found["ball"] for found in levels["drawn"]]
    assert len({(ball["places"], ball["triangles"]) for ball in balls}) == 1
    assert len({ball["own"] for ball in balls}) == 3
    for ball in balls:
        assert ball["volume"] == pytest.approx(4 / 3 * np.pi * 0.25**3, rel=0.1)


def test_a_refused_level_says_why_and_changes_nothing(levels):
    expected = {
        "below": "level is -1, and asset 1 has 3: give 0 to 2",
        "beyond": "level is 3, and asset 1 has 3: give 0 to 2",
        "joined": "the body in slot 3 has joints on its vertices: release or remove them before",
    }
    assert levels["refused"].keys() == expected.keys()
    for what, found in levels["refused"].items():
        assert found["error"].startswith(expected[what])
        assert not found["answer"], what
        assert found["are_same"], what
    assert levels["nobody"] == [False, "body 12345 is not in this world, or was removed"]


def test_release_lets_a_joint_go_with_the_change(levels):
    released = levels["released"]
    assert released["was"]
    assert released["answer"]
    assert released["joint"] == 0
    require_level(released["drawn"], 1)


def test_a_snapshot_restores_the_level_that_is_drawn(levels):
    """A body that is spawned in the slot starts at the finest level."""
    coarse, restored, despawned, spawned = levels["rewind"]
    require_level(coarse, 2)
    require_level(restored, 0)
    assert despawned == {}
    require_level(spawned, 0)


def test_the_script_of_the_page_chooses_levels_by_distance(levels):
    assert levels["afar"] == [0, 1, 2, 2, 0]


@pytest.fixture(scope="module")
def drives(run, world_of):
    """Motion of bodies under the functions of soft_world.gd for gravity, friction, joints and motors."""
    world_of("joined")
    return told(run("drives.gd"))


def test_gravity_is_set(drives):
    """The motion lasts half a second."""
    fall = drives["fall"]
    assert fall["answer"]
    assert fall["moved"] == pytest.approx([0.125, -0.25, 0.5], abs=0.005)


def test_a_collider_brakes_by_its_friction(drives):
    """From 1 m/s: without friction a second goes by, with it a length of v^2 / (2 mu g)."""
    lengths = [found["moved"][1] for found in drives["floor"]]
    assert all(found["answer"] for found in drives["floor"])
    assert lengths == pytest.approx([1.0, 1 / (0.4 * 9.81), 1 / (0.8 * 9.81)], rel=0.05)


def test_a_body_brakes_another_by_its_friction(drives):
    assert [found["answers"] for found in drives["stack"]] == [[True, True]] * 2
    slides, stays = (abs(found["apart"][0]) for found in drives["stack"])
    assert slides > 0.12
    assert stays < 0.06


def test_a_joint_bears_a_body_until_it_is_released(drives):
    hang = drives["hang"]
    weight = 0.4 * 0.4 * 0.3 * 1000 * 9.81
    assert hang["listed"]
    assert hang["force"] == pytest.approx([0.0, 0.0, weight], abs=0.02 * weight)
    assert hang["sank"] < 0.02
    assert hang["released"] == [True, False]
    assert hang["fell"] == pytest.approx(9.81 / 2 * (20 / 64) ** 2, rel=0.05)
    assert hang["onto"] < 1e-4  # vertices that were joined one to one


def test_a_motor_turns_a_body_as_it_is_set(drives):
    turn = drives["turn"]
    assert turn["listed"]
    assert turn["answers"] == [True, True, True]
    assert turn["speed"] == pytest.approx(3.0, rel=0.1)
    assert turn["back"] == pytest.approx(-2.0, rel=0.1)
    assert turn["coasts"] == pytest.approx(-2.0, abs=1.0)  # its limit is 0, though 9 rad/s are asked for
    assert turn["removed"] == [True, False, 0]
    assert turn["gone"] == [False, False]


def test_joints_and_motors_are_found_by_name_and_number(drives):
    assert drives["names"] == {
        "there": True,
        "numbers": [True, True],
        "nobody": [0, 0, 0],
        "set": [False, False],
    }


def test_these_tests_call_every_such_function_of_the_node():
    node = files_of(3)["addons/taichi_soft/soft_world.gd"]
    named = re.findall(r"^func (\w*(?:gravity|friction|join|motor|level)\w*)\(", node, re.MULTILINE)
    assert len(named) == 15
    scripts = "".join((SCRIPTS / name).read_text(encoding="utf-8") for name in ("drives.gd", "levels.gd"))
    assert [name for name in named if f"_world.{name}(" not in scripts] == []


def test_the_script_of_the_page_runs(run, project):
    """Its elephant falls, and is drawn; the mouse takes it, and it is hung up."""
    text = (ROOT / "docs" / "godot.md").read_text(encoding="utf-8")
    sections = text.split("\n## Script reference\n")[1].split("\n## Rigid bodies\n")[0]
    scripts = re.findall(r"^```gdscript\n(.*?)^```", sections, re.DOTALL | re.MULTILINE)
    assert len(scripts) == 3
    (project / "page.gd").write_text("\n".join(["extends Spatial", *scripts]), encoding="utf-8")
    printed = run("page_check.gd")
    assert re.search(r"^an impulse of \d+\.\d\d N s on Ground$", printed, re.MULTILINE)
    found = told(printed)["page"]
    assert found["held"]
    assert found["pulled"] == pytest.approx(found["hand"], abs=0.3)  # it would have fallen
    assert found["let_go"]
    assert found["hangs"] == pytest.approx(found["hook"], abs=0.3)
    assert found["nodes"] == 1
    assert found["vertices"] > 8000
    assert 0.3 < found["height"] < 2.1


REFUSED = [
    "cannot read no/such/folder/world.tsw",
    "world 0 does not exist",
    "body 12345 is not in this world",
    "argument 1 is not a whole number",
    "takes 2 arguments, got 1",
    "seconds is -1",
    "seconds is -?nan",
    r"asset 99 does not exist \(2 in all",
    "position has -?nan in it",
    "argument 2 is a Transform that mirrors",
    "argument 2 is a Transform without size",
    "frame 7 does not exist",
    "unknown name nobody",
    "argument 1 is 9: give a kind from 0 to 4",
    r"mesh 77 does not exist \(2 in all",
    "3 bytes are not a snapshot",
    "bytes is null",
    "body 1099511627776 is not in this world",
    "argument 1 is 1099511627776: too large",
    "kinds is -1",
    "direction has zero length",
    "radius is -1",
    "argument 1 is not a Transform",
    "weights must be 0 or more and have the sum 1",
    "grab 7 is not in this world, or was released",
    "argument 1 is a Transform without size",
    "argument 2 is not a PoolIntArray",
    "frame 0 does not exist",
    "vertex 1073741824 does not exist",
    "frame 0 does not exist",
    "body 0 is not in this world",
]


def test_bad_arguments_are_errors_and_no_crash(run):
    found = told(run("refused.gd"))
    answers = sorted(found["native"].items(), key=lambda item: int(item[0].split()[0]))
    assert len(answers) == len(REFUSED)
    for (call, (is_null, text)), expected in zip(answers, REFUSED, strict=True):
        assert is_null, call
        assert re.match(expected, text), call
    node = found["node"]
    assert node["made"] == [*range(8), -1, 3]  # as many as there is room for; then one more
    not_started, started = node["answers"][:4], node["answers"][4:]
    assert not_started == [False, 0, "", False]
    assert started == [
        *(True, 0, 0, False, False, -1, -1, -1, False, False),
        *("(0, 0, 0)", True, False, True),
        *(0, False, False, "(0, 0, 0)", False, False, False),
        *(True, "(0, 0, 0)", [], "[]", {}),
    ]
