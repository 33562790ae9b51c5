"""Scenes as scripts: another law and larger capacities, without a change of the scene."""

import io
import math
import zipfile
from dataclasses import replace

import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft import Material, OptionError, SoftBodyAsset, World, box, element_model, stable_step
from taichi_soft.live import choices
from taichi_soft.live.choices import PALETTES
from taichi_soft.live.controls import Controls
from taichi_soft.live.saving import packed, saved_script
from taichi_soft.live.scene import SceneSource, found_source, made_scene
from taichi_soft.world.bare import bare_world

SOFT = Material(young=1e5, poisson=0.3, density=500.0)
SCENE = """
from taichi_soft import Material, SoftBodyAsset, World, box

soft = Material(young=1e5, poisson=0.3, density=500.0)
asset = SoftBodyAsset(box((0.5, 0.5, 0.5), (1, 1, 1)), soft, strain="exact")
game = World(gravity=(0, 0, -2), soft_contact=False)
game.add_body(box((0.5, 0.5, 0.5), (1, 1, 1)), soft, position=(0, 0, 1))
game.reserve(asset, 2)
game.spawn(asset, position=(1, 0, 1))
"""


def laws(world):
    return [body.asset.law for body in world.bodies]


def test_a_script_gets_another_law_for_all_its_bodies_and_room_for_more(tmp_path):
    path = tmp_path / "game.py"
    path.write_text(SCENE)
    scene = made_scene(SceneSource("script", str(path), law="st_venant_kirchhoff"))
    assert laws(scene.world) == ["st_venant_kirchhoff"] * 2
    palette = PALETTES[scene.world]
    body = scene.world.spawn(palette["ring"], position=(3.0, 0.0, 2.0))
    assert laws(scene.world)[-1] == "st_venant_kirchhoff"
    assert body.vertex_count > 0
    assert scene.world.settings.gravity[2] == -2.0


def test_without_a_choice_a_scene_is_as_it_says(tmp_path):
    path = tmp_path / "game.py"
    path.write_text(SCENE)
    assert laws(made_scene(SceneSource("script", str(path))).world) == ["neo_hookean", "virial"]


def test_worlds_that_are_made_outside_are_as_ever_also_after_an_error():
    before = {name: getattr(World, name) for name in ("add_body", "reserve", "spawn", "build")}
    with pytest.raises(OptionError, match="magic"), choices(law="magic", has_palette=True):
        bare_world().add_body(box((0.5, 0.5, 0.5), (1, 1, 1)), SOFT)
    assert {name: getattr(World, name) for name in before} == before
    asset = SoftBodyAsset(box((0.5, 0.5, 0.5), (1, 1, 1)), SOFT)
    assert bare_world(floor=None).add_body(asset).asset is asset


def test_what_a_command_names_is_found_and_what_is_none_is_refused(tmp_path):
    script, mesh = tmp_path / "game.py", tmp_path / "duck.obj"
    script.write_text(SCENE)
    mesh.write_text("v 0 0 0\n")
    assert found_source(None).kind == "playground"
    assert found_source("jelly") == SceneSource("demo", "jelly")
    assert found_source(str(script)).kind == "script"
    assert found_source(str(mesh)).meshes == (str(mesh),)
    with pytest.raises(OptionError, match=r"castle.*bounce"):
        found_source("castle")


@pytest.mark.parametrize("kind", ["playground", "demo", "script"])
def test_scripts_are_sound_and_name_files_beside_them(kind, tmp_path):
    source = SceneSource(
        kind, {"demo": "jelly", "script": "/a/b/game.py"}.get(kind, ""), meshes=("/c/d.obj",)
    )
    text = source.script(is_alone=True)
    compile(text, "scene.py", "exec")
    assert "/a/b" not in text
    assert "/c" not in text
    assert "\"files\" / 'd.obj'" in text


def test_a_script_that_makes_no_world_or_two_is_refused(tmp_path):
    for number, text in enumerate(("x = 1\n", "from taichi_soft import World\na, b = World(), World()\n")):
        path = tmp_path / f"game{number}.py"
        path.write_text(text)
        with pytest.raises(OptionError, match="exactly one global World"):
            made_scene(SceneSource("script", str(path)))


def test_a_saved_script_and_that_of_the_scene_do_not_take_each_others_place(tmp_path):
    path = tmp_path / "scene.py"
    path.write_text(SCENE)
    source = SceneSource("script", str(path))
    text = saved_script(source, "0" * 16, 1 / 60, 4)
    with zipfile.ZipFile(io.BytesIO(packed(text, b"snapshot", source))) as archive:
        assert sorted(archive.namelist()) == ["files/scene.py", "scene.py", "scene.snapshot"]
        assert archive.read("scene.py").decode() == text
        assert archive.read("files/scene.py").decode() == SCENE


def test_the_substeps_predicted_for_another_material_are_those_that_bodies_of_it_need():
    """The bodies have different sizes, stiffness and shapes, and one material.

    A new estimate of each is the reference.
    """
    with choices(has_palette=True):
        world = bare_world()
        world.add_body(box((2.0, 2.0, 0.2), (6, 6, 1)), SOFT, position=(0, 0, 1))
        stiff = Material(young=4e5, poisson=0.2, density=500.0)
        world.add_body(box((2.0, 2.0, 2.0), (2, 2, 2)), stiff, position=(0, 0, 4))
        world.build()
    controls = Controls(world, 1 / 60, None)
    for young, poisson in ((1e6, 0.3), (1e7, 0.45)):
        controls.given.update(young=young, poisson=poisson)
        needed = 0
        for asset in [*(body.asset for body in world.bodies), *PALETTES[world].values()]:
            material = replace(asset.material, young=young, poisson=poisson)
            step = stable_step(asset.mesh, material, element_model(asset.law)).recommended
            needed = max(needed, math.ceil(1 / 60 / step))
        assert needed <= controls.stable_substeps <= 1.25 * needed + 1
