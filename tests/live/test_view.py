"""A world that a script steps and a browser shows and moves."""

import subprocess
from types import SimpleNamespace

import numpy as np
import pytest
from visitor import Visitor

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Material, OptionError, StateError, box
from taichi_soft.live import view
from taichi_soft.world.bare import bare_world

SOFT = Material(young=1e5, poisson=0.3, density=500.0)


@pytest.fixture(scope="module")
def world():
    world = bare_world(gravity=(0.0, 0.0, 0.0))
    world.add_body(box((0.5, 0.5, 0.5), (2, 2, 2)), SOFT, position=(0.0, 0.0, 1.0), velocity=(0.5, 0.0, 0.0))
    world.build()
    return world


@pytest.fixture(scope="module")
def window(world):
    with view(world, colors={world.bodies[0]: (0.2, 0.4, 0.6)}) as window:
        yield window


def until(window, visitor, found, step=lambda: None):
    """Run the loop of a script until a condition holds."""
    for _ in range(400):
        step()
        window.update()
        visitor.listen(0.05)
        if found():
            return
    raise AssertionError(f"nothing of the kind; said: {visitor.said}, refused: {visitor.refused}")


def test_pictures_are_where_the_script_has_stepped_the_world_to(world, window):
    with Visitor(window.address) as visitor:
        until(window, visitor, lambda: 0 in visitor.pictures, lambda: world.step(1 / 60))
        moment = world.time
        until(window, visitor, lambda: visitor.pictures[0]["time"] == moment)
        mesh = world.bodies[0].render_mesh(crease=40.0)
        there, _ = world.read_render_mesh(mesh, 1.0)
        picture = visitor.pictures[0]
        assert (np.abs(picture["positions"] - there) <= 0.5 * picture["quantum"] + 1e-6).all()
        assert (visitor.drawn[0][1]["colors"][0] == [51, 102, 153]).all()


def test_a_visitor_pulls_a_body_between_the_scripts_steps_and_decides_nothing_else(world, window):
    with Visitor(window.address) as visitor:
        until(window, visitor, lambda: 0 in visitor.pictures)
        x, y, z = world.bodies[0].center_of_mass()
        visitor.say("grab", origin=[x, y, 9.0], direction=[0.0, 0.0, -1.0])
        visitor.say("move", point=[x, y, z + 1.0])
        until(window, visitor, lambda: len(world.grabs) == 1)
        until(
            window, visitor, lambda: world.bodies[0].center_of_mass()[2] > z + 0.3, lambda: world.step(1 / 60)
        )
        for do in ("reset", "despawn", "step"):
            visitor.say(do)
        until(window, visitor, lambda: len(visitor.refused) == 3)
        assert "another program" in visitor.refused[0]
    for _ in range(100):
        window.update()
        if not world.grabs:
            break
        import time

        time.sleep(0.02)
    assert not world.grabs


def test_a_view_that_is_closed_lets_go_of_what_visitors_hold(world):
    window = view(world)
    with Visitor(window.address) as visitor:
        until(window, visitor, lambda: 0 in visitor.pictures)
        x, y, _ = world.bodies[0].center_of_mass()
        visitor.say("grab", origin=[x, y, 9.0], direction=[0.0, 0.0, -1.0])
        until(window, visitor, lambda: len(world.grabs) == 1)
        window.close()
    assert not world.grabs


def test_how_late_a_picture_is_leaves_out_how_long_a_world_stood(world, window):
    simulation, told = window._simulation, []
    x, y, z = world.bodies[0].center_of_mass()
    simulation.connection = SimpleNamespace(send=told.append, poll=lambda: False)
    try:
        simulation.do_grab(99, [x, y, 9.0], [0.0, 0.0, -1.0])
        for number, is_paused in ((1, True), (2, None), (3, False), (4, None)):
            simulation.do_move(99, [x, y, z], number)
            if is_paused is not None:
                simulation.do_pause(is_paused)
        world.step(1 / 60)
        simulation._due["frame"] = 0.0
        window.update()
        simulation.do_release(99)
    finally:
        simulation.connection = window._connection
    pulls = [message[2] for message in told if message[0] == "frame"]
    assert pulls == [{99: 4}]


def test_a_notebook_gets_a_frame_with_the_address(window):
    html = window._repr_html_()
    assert f'src="{window.address}"' in html
    assert "title=" in html


def test_what_is_no_built_world_is_refused():
    with pytest.raises(OptionError, match="world must be"):
        view("world")
    with pytest.raises(StateError, match="build"):
        view(bare_world())


@pytest.mark.parametrize(
    "options",
    [
        {"colors": [1]},
        {"colors": {0: (1.0, 0.0, 0.0)}},
        {"colors": "red"},
        {"height": "1px"},
        {"height": 0},
    ],
)
def test_odd_options_are_refused_before_anything_is_served(world, options):
    with pytest.raises(OptionError, match=next(iter(options))):
        view(world, **options)


@pytest.mark.parametrize("color", ["red", (1.0, 0.0), (1.0, 0.0, 7.0)])
def test_an_odd_colour_is_refused_before_anything_is_served(world, color):
    with pytest.raises(OptionError, match="color"):
        view(world, colors={world.bodies[0]: color})


def test_a_server_that_ends_before_it_serves_is_told_of(world, monkeypatch, tmp_path):
    (tmp_path / "ends.py").write_text(
        "import os, sys\nfrom multiprocessing.connection import Client\n"
        "host, port = sys.argv[1].split(':')\n"
        "Client((host, int(port)), authkey=bytes.fromhex(os.environ['TAICHI_SOFT_VIEW_KEY']))\n"
    )
    start = subprocess.Popen

    def ends_at_once(command, **options):
        return start([command[0], str(tmp_path / "ends.py"), command[-1]], **options)

    monkeypatch.setattr(subprocess, "Popen", ends_at_once)
    with pytest.raises(StateError, match=r"server.*(could not start|ended)"):
        view(world)


def test_a_view_of_an_adapter_ends_where_it_is_closed(world):
    window = view(EngineAdapter(world, FixedStep()))
    server = window._server
    window.close()
    assert server.poll() is not None
    with pytest.raises(StateError, match="closed"):
        window.update()
