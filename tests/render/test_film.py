"""Films: the right number of frames of the right moments, and nothing where it is refused."""

import cv2
import numpy as np
import pytest
import trimesh
from PIL import Image

from engine_adapter import FixedStep
from taichi_soft import (
    BoxShape,
    Material,
    OptionError,
    SoftBodyAsset,
    SpringMaterial,
    StateError,
    VideoError,
    World,
    box,
    rope,
)
from taichi_soft.render import Camera, ColorScale, Renderer, VideoWriter
from taichi_soft.render.artist import speed_of
from taichi_soft.render.film import Actor, Follow, Stage, film
from taichi_soft.render.props import SLATE, Scenery
from taichi_soft.world.bare import bare_world


def falling_box(dt: float = 1 / 50) -> Stage:
    world = bare_world()
    body = world.add_body(box((1, 1, 1), (2, 2, 2)), Material(1e5, 0.2, 1000, 10), position=(0, 0, 4))
    world.build()
    camera = Camera.framing((-1, -1, 0), (1, 1, 5))
    return Stage("box", world, [Actor(body, label="box")], camera, FixedStep(dt=dt), 1.0)


def test_skins_are_drawn_with_their_textures(tmp_path):
    """A crate with blue corners, and with faces that are red in the middle.

    No vertex is red. Next to it is a crate without a texture, in the colour of its actor.
    """
    crate = trimesh.creation.box()
    normals = np.repeat(crate.face_normals, 3, axis=0)
    crate.unmerge_vertices()
    flat = np.argsort(np.abs(normals), axis=1, kind="stable")[:, :2]
    uv = np.take_along_axis(crate.vertices, flat, axis=1) + 0.5
    pixels = np.full((8, 8, 3), (20, 20, 230), np.uint8)
    pixels[2:6, 2:6] = (230, 20, 20)
    picture = trimesh.visual.TextureVisuals(uv=uv, image=Image.fromarray(pixels))
    textured = trimesh.Trimesh(crate.vertices, crate.faces, process=False, visual=picture)
    world = bare_world()
    for mesh, x in ((textured, -0.8), (trimesh.creation.box(), 0.8)):
        asset = SoftBodyAsset.from_surface(mesh, Material(1e6, 0.2, 1000.0), cells=3)
        world.add_body(asset, position=(x, 0, 0.6))
    world.build()
    actors = [Actor(body, (0.1, 0.9, 0.1)) for body in world.bodies]
    stage = Stage("", world, actors, Camera.framing((-1.4, -1, 0), (1.4, 1, 1.2)), FixedStep(dt=1 / 50), 1.0)
    film(stage, tmp_path / "s.png", seconds=0.02, size=(200, 150))
    blue, green, red = cv2.imread(str(next(tmp_path.glob("s_*.png")))).astype(int)[40:].T
    assert ((red > blue + 60) & (red > green + 60)).sum() > 300
    assert ((blue > red + 60) & (blue > green + 60)).sum() > 300
    assert ((green > red + 60) & (green > blue + 60)).sum() > 600


def test_frames_show_every_fixed_step_where_both_rates_agree(tmp_path):
    stage = falling_box()
    seen = []
    report = film(stage, tmp_path / "b.mp4", size=(160, 120), on_frame=lambda *now: seen.append(now))
    assert report.frames == 50
    assert len(report.draw_times) == 50
    assert seen == [(i + 1, 50) for i in range(50)]
    assert stage.world.step_count == 49
    assert report.simulated == pytest.approx(0.98)
    assert int(cv2.VideoCapture(str(report.path)).get(cv2.CAP_PROP_FRAME_COUNT)) == 50


def test_the_time_in_the_picture_is_that_of_the_body_in_it(tmp_path, monkeypatch):
    """In free fall from z0 the lowest point is at z0 - g t^2 / 2 at the time that the panel tells."""
    told, drawn = [], []
    monkeypatch.setattr("taichi_soft.render.artist.draw_text", lambda picture, lines: told.append(lines[1]))
    original = Renderer.render

    def watched(self, surfaces):
        drawn.append(surfaces[0].positions[:, 2].min())
        return original(self, surfaces)

    monkeypatch.setattr(Renderer, "render", watched)
    film(falling_box(), tmp_path / "b.png", seconds=0.5, size=(160, 120), stats=True)
    times = np.array([float(line.split()[2]) for line in told])
    assert times[-1] == pytest.approx(0.46)  # of 0.48 put in: one step behind, to interpolate
    np.testing.assert_allclose(drawn, 3.5 - 0.5 * 9.81 * times**2, atol=1e-5)


def test_what_is_compiled_before_the_first_frame_moves_nothing(tmp_path):
    """The film ends in the same state, bit by bit, as a world that was only stepped."""
    stage, alone = falling_box(), falling_box()
    report = film(stage, tmp_path / "b.png", seconds=0.5, size=(160, 120))
    for _ in range(stage.world.step_count):
        alone.world.step(stage.step.dt)
    np.testing.assert_array_equal(stage.actors[0].body.positions(), alone.actors[0].body.positions())
    assert stage.world.step_count == 24
    assert report.simulated == pytest.approx(24 * stage.step.dt)


def test_everything_is_drawn_and_stepped_once_before_the_first_frame(monkeypatch, tmp_path):
    """This includes the worlds of all actors."""
    done = []
    original = Renderer.render
    monkeypatch.setattr(Renderer, "render", lambda *given: done.append("draw") or original(*given))
    monkeypatch.setattr("taichi_soft.render.film.warm_up_step", lambda context: done.append("step"))
    write = VideoWriter.write
    monkeypatch.setattr(VideoWriter, "write", lambda *given: done.append("write") or write(*given))
    stage, other = falling_box(), falling_box()
    stage.actors.append(Actor(other.actors[0].body, world=other.world))
    film(stage, tmp_path / "b.png", seconds=0.04, size=(160, 120))
    assert done == ["step", "step", "draw", "draw", "write", "draw", "write"]


def test_the_picture_says_how_fast_the_last_frames_were_whatever_one_of_them_took():
    for times, told in (
        ([9.0], ""),
        ([9.0, 0.002], "10 x real time"),
        ([9.0, *[0.04] * 12, 30.0, *[0.04] * 12], "0.5 x real time"),
        ([9.0, *[5.0] * 30, *[0.0016] * 25], "12 x real time"),
        ([9.0, 1.0], "0.02 x real time"),
    ):
        assert speed_of(times, 50.0) == told


def test_a_label_stands_on_the_floor_in_front_of_the_body(monkeypatch, tmp_path):
    """Wherever the body is above it: below all of its pixels, and as far as the floor goes."""
    places = []
    monkeypatch.setattr(
        "taichi_soft.render.artist.draw_labels", lambda picture, labels, rows: places.append(rows)
    )
    stage = falling_box()
    film(stage, tmp_path / "b.png", seconds=0.4, size=(160, 120))
    camera = stage.camera
    way = np.subtract(camera.eye, camera.target)[:2]
    foot = [*(0.6 * way / np.linalg.norm(way)), 0.0]
    for rows in places:
        np.testing.assert_allclose(rows[0], camera.project([foot], 160, 120)[0], atol=0.05)


def test_the_real_time_factor_is_simulated_time_over_time_taken():
    report = film(falling_box(), None, seconds=0.4)
    assert len(report.step_times) == report.frames - 1
    expected = len(report.step_times) * 0.02 / report.step_times.sum()
    assert report.real_time_factor == pytest.approx(expected)
    assert report.path is None
    assert len(report.draw_times) == 0


def drawn_by(monkeypatch):
    """Return a list to which the positions of the first surface in each new image are added."""
    drawn = []
    original = Renderer.render

    def watched(self, surfaces):
        drawn.append(surfaces[0].positions.copy())
        return original(self, surfaces)

    monkeypatch.setattr(Renderer, "render", watched)
    return drawn


def test_slow_motion_shows_the_same_states_of_the_world_and_what_lies_between(monkeypatch, tmp_path):
    """Every fourth image is one of the film at full speed. The other images are interpolated linearly."""
    drawn = drawn_by(monkeypatch)
    plain, slowed = falling_box(), falling_box()
    film(plain, tmp_path / "p.png", seconds=0.2, size=(160, 120))
    fast = [rows.copy() for rows in drawn[1:]]  # the first picture is drawn to compile
    drawn.clear()
    report = film(slowed, tmp_path / "s.png", seconds=0.2, size=(160, 120), slow=4)
    slow = drawn[1:]
    assert report.frames == len(slow) == 4 * len(fast) == 40
    assert slowed.world.step_count == plain.world.step_count
    assert slowed.world.state_hash() == plain.world.state_hash()
    for number, rows in enumerate(fast[2:-1], start=2):
        np.testing.assert_allclose(slow[4 * number], rows, atol=1e-6)
        between = rows + 0.75 * (fast[number + 1] - rows)
        np.testing.assert_allclose(slow[4 * number + 3], between, atol=1e-6)
    assert report.real_time_factor == pytest.approx(39 * 0.005 / report.step_times.sum())


def test_what_is_slowed_says_so(monkeypatch, tmp_path):
    told = []
    monkeypatch.setattr("taichi_soft.render.artist.draw_text", lambda picture, lines: told.append(lines))
    film(falling_box(), tmp_path / "s.png", seconds=0.04, size=(160, 120), slow=2.5)
    assert told[-1] == ["box", "shown 2.5 x slower"]


def test_an_empty_title_or_caption_leaves_no_panel_and_no_blank_line(monkeypatch, tmp_path):
    told = []
    monkeypatch.setattr("taichi_soft.render.artist.draw_text", lambda picture, lines: told.append(lines))
    stage = falling_box()
    stage.title, stage.caption = "", lambda: ""
    film(stage, tmp_path / "s.png", seconds=0.04, size=(160, 120))
    assert told[-1] == []
    film(stage, tmp_path / "s.png", seconds=0.04, size=(160, 120), slow=2.5)
    assert told[-1] == ["shown 2.5 x slower"]


def test_a_blurred_film_shows_the_time_of_the_shutter_and_the_world_makes_the_same_steps(
    monkeypatch, tmp_path
):
    drawn = drawn_by(monkeypatch)
    plain, blurred = falling_box(), falling_box()
    film(plain, None, seconds=0.2)
    film(blurred, tmp_path / "b.png", seconds=0.2, size=(160, 120), blur=3)
    assert plain.world.state_hash() == blurred.world.state_hash()
    heights = np.array([rows[:, 2].min() for rows in drawn[2:]]).reshape(-1, 3)
    # In steps of half a frame from the shutter's opening to its closing, in free fall.
    falls = -np.diff(heights[2:], axis=1)
    assert (falls > 0).all()
    np.testing.assert_allclose(falls[:, 0], falls[:, 1], rtol=1e-2)
    np.testing.assert_allclose(
        heights[3:, 0] - heights[3:, 2], (heights[2:-1, 2] - heights[3:, 2]) / 2, rtol=1e-2
    )


def test_a_blurred_film_of_what_stands_still_is_the_sharp_film(tmp_path):
    world = bare_world(gravity=(0.0, 0.0, 0.0))
    body = world.add_body(box((1, 1, 1), (2, 2, 2)), Material(1e5, 0.2, 1000, 10), position=(0, 0, 1))
    world.build()
    camera = Camera.framing((-1, -1, 0), (1, 1, 2))
    pictures = {}
    for blur in (1, 4):
        stage = Stage("", world, [Actor(body)], camera, FixedStep(dt=0.02), 1.0)
        film(stage, tmp_path / f"{blur}.png", seconds=0.06, size=(320, 240), blur=blur)
        pictures[blur] = cv2.imread(str(tmp_path / f"{blur}_0002.png"))[80:]  # below the words
    np.testing.assert_array_equal(pictures[1], pictures[4])


def test_a_camera_that_follows_keeps_a_falling_body_in_the_picture(monkeypatch, tmp_path):
    """With a fixed camera, the body leaves the image."""
    cameras, drawn = [], drawn_by(monkeypatch)
    watched = Renderer.render
    monkeypatch.setattr(
        Renderer, "render", lambda self, surfaces: cameras.append(self.camera) or watched(self, surfaces)
    )
    stage = falling_box()
    stage.camera = Follow(stage.actors[0].body, Camera((0, -5, 4), (0, 0, 4), fov_degrees=40))
    film(stage, tmp_path / "f.png", seconds=0.8, size=(160, 120))
    for camera, rows in zip(cameras, drawn, strict=True):
        pixels = camera.project(rows, 160, 120)[:, :2]
        assert ((pixels > 0) & (pixels < (160, 120))).all()
    assert (cameras[0].project(drawn[-1], 160, 120)[:, 1] > 120).any()


def test_a_camera_that_follows_what_is_not_drawn_is_refused_before_anything_moves(tmp_path):
    stage, other = falling_box(), falling_box()
    stage.camera = Follow(other.actors[0].body, stage.camera)
    with pytest.raises(OptionError, match="not an actor"):
        film(stage, tmp_path / "f.png", seconds=0.1)
    assert stage.world.step_count == 0
    assert not list(tmp_path.iterdir())


def test_the_picture_changes_as_the_body_falls(tmp_path):
    film(falling_box(), tmp_path / "f.png", seconds=0.6, fps=10, size=(160, 120))
    first, last = (cv2.imread(str(tmp_path / f"f_{i:04}.png")) for i in (0, 5))
    assert np.abs(first.astype(int) - last.astype(int)).max() > 60


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("seconds", 0.0), ("seconds", 1e300), ("seconds", np.nan), ("fps", -5), ("fps", "x")),
        *(("slow", 0.5), ("slow", np.nan), ("blur", 0), ("blur", 1.5), ("blur", 65)),
    ],
)
def test_a_wrong_number_is_refused_before_anything_moves(option, value, tmp_path):
    stage = falling_box()
    with pytest.raises(OptionError, match=option):
        film(stage, tmp_path / "f.mp4", **{option: value})
    assert stage.world.step_count == 0
    assert not list(tmp_path.iterdir())


def test_a_film_of_no_known_kind_is_refused_before_anything_moves(tmp_path):
    stage = falling_box()
    with pytest.raises(VideoError, match="webm"):
        film(stage, tmp_path / "f.xyz")
    assert stage.world.step_count == 0


def test_frames_too_long_for_the_steps_they_may_take_are_refused(tmp_path):
    stage = falling_box()
    with pytest.raises(OptionError, match=r"6\.25 or more"):
        film(stage, None, fps=2)
    assert stage.world.step_count == 0


def test_simulated_time_is_that_of_the_world():
    stage = falling_box(dt=1 / 60)
    report = film(stage, None, seconds=0.5)
    assert report.simulated == stage.world.time > 0.4


@pytest.mark.soak
def test_colors_of_bodies_and_colliders_are_explained_and_told_apart(tmp_path):
    """The bar and the legend stand in the upper right corner; a collider may have a colour of its own."""
    world = bare_world()
    colliders = [world.add_collider(BoxShape((1, 1, 1)), position=(x, 0, 0.5)) for x in (-1.5, 1.5)]
    body = world.add_body(box((1, 1, 1), (2, 2, 2)), Material(1e5, 0.2, 1000, 10), position=(0, 0, 4))
    world.build()
    drawn = Scenery(world, [], {colliders[1]: (1.0, 0.0, 0.0)}).at(1.0)
    assert drawn[0].color.max() < 0.3
    np.testing.assert_allclose(drawn[1].color, [(1.0, 0.0, 0.0)] * len(drawn[1].color), atol=1e-6)
    camera = Camera.framing((-1, -1, 0), (1, 1, 5))
    pictures = {}
    for name, options in (
        ("plain", {}),
        ("bar", {"scale": ColorScale("stress", 0.0, 1e5, "Pa")}),
        ("legend", {"legend": [((0.0, 1.0, 0.0), "green")]}),
    ):
        stage = Stage("box", world, [Actor(body)], camera, FixedStep(dt=0.02), 1.0, **options)
        film(stage, tmp_path / f"{name}.png", seconds=0.02, size=(320, 240))
        pictures[name] = cv2.imread(str(tmp_path / f"{name}_0000.png")).astype(int)
    for name in ("bar", "legend"):
        rows, columns = np.nonzero(np.abs(pictures[name] - pictures["plain"]).max(axis=2) > 3)
        assert rows.max() < 120
        assert columns.min() > 160
    assert (pictures["legend"] == (0, 255, 0)).all(axis=2).sum() > 30


def test_colliders_have_another_colour_than_the_floor():
    """Their lightest and darkest tiles are far from it, in sRGB."""
    picture = Renderer(160, 120, camera=Camera.framing((-1, -1, 0), (1, 1, 1))).render([])
    floor = picture[-10:].reshape(-1, 3) / 255.0
    assert np.abs(floor - np.array(SLATE)).max(axis=1).min() > 0.15


def test_a_stage_of_a_world_shows_every_body_and_goes_on_from_where_it_stands(tmp_path):
    world = bare_world(floor=-0.5)
    places = [(-3.0, 0.0, 1.0), (0.0, 2.0, 0.1), (1.0, -1.0, 2.5)]
    for place in places:
        world.add_body(box((1, 1, 1), (2, 2, 2)), Material(1e5, 0.2, 1000, 10), position=place)
    world.add_body(rope(1.0, 4, 0.2), SpringMaterial(1000.0, 1.0), position=(1, 2, 1))
    world.build()
    calls = []
    stage = Stage.of(world, title="mine", seconds=0.1, step=FixedStep(dt=1 / 50), act=calls.append)
    assert [actor.body for actor in stage.actors] == list(world.bodies)
    assert len({actor.color for actor in stage.actors}) == 4
    seen = np.concatenate([*(actor.body.positions() for actor in stage.actors), [[-3.0, 0.0, -0.5]]])
    pixels = stage.camera.project(seen, 1280, 720)[:, :2]
    assert ((pixels > 0) & (pixels < (1280, 720))).all()
    report = film(stage, tmp_path / "w.png", size=(160, 120))
    assert report.frames == 5
    assert calls == 4 * [world]
    assert world.bodies[2].center_of_mass()[2] < 2.5


def built_but_empty():
    world = bare_world()
    world.reserve(SoftBodyAsset(box(), Material(1e5, 0.3, 1000.0)), 1)
    world.build()
    return world


@pytest.mark.parametrize(
    ("world", "error", "said"),
    [
        (lambda: "world", OptionError, "taichi_soft.World, got str"),
        (World, StateError, r"call world\.build\(\) before Stage\.of"),
        (built_but_empty, OptionError, "no bodies to draw"),
    ],
)
def test_a_stage_is_made_of_a_built_world_with_something_to_see(world, error, said):
    with pytest.raises(error, match=said):
        Stage.of(world())
