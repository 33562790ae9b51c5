"""Films: written, read back with OpenCV, refused, cleaned up."""

import cv2
import numpy as np
import pytest

from taichi_soft.core.errors import OptionError, StateError, VideoError
from taichi_soft.render import VideoWriter

WIDTH, HEIGHT = 96, 64
COLORS = [(220, 60, 40), (40, 200, 70), (50, 70, 220), (128, 128, 128), (240, 200, 60)]


def frame(color, width=WIDTH, height=HEIGHT):
    return np.full((height, width, 3), color, dtype=np.uint8)


def film(path, frames):
    with VideoWriter(path, fps=25, size=(WIDTH, HEIGHT)) as video:
        for picture in frames:
            video.write(picture)


def read(path):
    source = cv2.VideoCapture(str(path))
    frames = []
    while True:
        found, picture = source.read()
        if not found:
            return frames, source.get(cv2.CAP_PROP_FPS)
        frames.append(picture[..., ::-1])


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif", ".MP4"])
def test_film_holds_every_frame_in_size_and_color(tmp_path, suffix, capfd):
    path = tmp_path / "new" / "folder" / f"film{suffix}"
    with VideoWriter(path, fps=25, size=(WIDTH, HEIGHT)) as video:
        for color in COLORS:
            video.write(frame(color))
    frames, fps = read(path)
    assert len(frames) == len(COLORS)
    assert fps == pytest.approx(25, rel=0.01)
    for seen, color in zip(frames, COLORS, strict=True):
        assert seen.shape == (HEIGHT, WIDTH, 3)
        np.testing.assert_allclose(seen.reshape(-1, 3).mean(axis=0), color, atol=12)
    assert names(path.parent) == [path.name]
    assert capfd.readouterr() == ("", "")


def test_pictures_are_numbered_and_exact(tmp_path):
    with VideoWriter(tmp_path / "bounce.png", fps=30, size=(33, 21)) as video:
        for color in COLORS:
            video.write(frame(color, 33, 21))
    assert names(tmp_path) == [f"bounce_{i:04d}.png" for i in range(5)]
    for i, color in enumerate(COLORS):
        picture = cv2.imread(str(tmp_path / f"bounce_{i:04d}.png"))[..., ::-1]
        np.testing.assert_array_equal(picture, frame(color, 33, 21))


def test_a_shorter_sequence_leaves_nothing_of_the_longer(tmp_path):
    (tmp_path / "bounce_note.png").touch()
    (tmp_path / "other_0004.png").touch()
    for count in (5, 2):
        with VideoWriter(tmp_path / "bounce.png", fps=30, size=(WIDTH, HEIGHT)) as video:
            for color in COLORS[:count]:
                video.write(frame(color))
    assert names(tmp_path) == ["bounce_0000.png", "bounce_0001.png", "bounce_note.png", "other_0004.png"]


def test_gif_times_do_not_drift(tmp_path):
    path = tmp_path / "film.gif"
    with VideoWriter(path, fps=30, size=(16, 16)) as video:
        for i in range(30):
            video.write(frame((8 * i, 0, 0), 16, 16))
    found, animation = cv2.imreadanimation(str(path))
    assert found
    assert sum(animation.durations) == 1000
    assert set(np.ravel(animation.durations)) <= {30, 40}


def test_equal_frames_are_all_kept(tmp_path):
    for suffix in (".mp4", ".webm", ".gif", ".png"):
        with VideoWriter(tmp_path / f"still{suffix}", fps=10, size=(WIDTH, HEIGHT)) as video:
            for _ in range(7):
                video.write(frame((90, 120, 150)))
        assert video.count == 7


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((HEIGHT, WIDTH + 2, 3), np.uint8),
        np.zeros((WIDTH, HEIGHT, 3), np.uint8),
        np.zeros((HEIGHT, WIDTH, 4), np.uint8),
        np.zeros((HEIGHT, WIDTH), np.uint8),
        np.zeros((HEIGHT, WIDTH, 3), np.float32),
        np.zeros((HEIGHT, WIDTH, 3), np.int8),
        [[0, 0, 0]],
        None,
    ],
)
def test_wrong_frames_are_refused_and_nothing_is_left(tmp_path, bad):
    with pytest.raises(VideoError, match="frame 1 must be uint8 of shape"):
        film(tmp_path / "film.mp4", [frame(COLORS[0]), bad])
    assert names(tmp_path) == []


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif", ".png"])
def test_an_exception_inside_leaves_the_old_film(tmp_path, suffix):
    path = tmp_path / f"film{suffix}"
    kept = tmp_path / "film_0000.png" if suffix == ".png" else path
    kept.write_bytes(b"old")
    frames = (frame(COLORS[i]) for i in range(len(COLORS) + 1))  # the last one fails
    with pytest.raises(IndexError):
        film(path, frames)
    assert names(tmp_path) == [kept.name]
    assert kept.read_bytes() == b"old"


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif", ".png"])
def test_a_film_without_frames_is_an_error_and_no_file(tmp_path, suffix):
    with pytest.raises(VideoError, match="no frame"):
        film(tmp_path / f"film{suffix}", [])
    assert names(tmp_path) == []


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
@pytest.mark.parametrize("size", [(95, 64), (96, 63)])
def test_odd_sizes_are_refused_where_a_film_would_be_cut(tmp_path, suffix, size):
    with pytest.raises(VideoError, match="even"):
        VideoWriter(tmp_path / f"film{suffix}", fps=25, size=size)
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["film.avi", "film", "film.mp4.txt", ".mp4"])
def test_unknown_suffixes_are_refused_with_the_known(tmp_path, name):
    with pytest.raises(VideoError, match=r"\.mp4, \.webm, \.gif, \.png"):
        VideoWriter(tmp_path / name, fps=25, size=(WIDTH, HEIGHT))


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif", ".png"])
def test_a_place_that_cannot_be_written_is_one_line(tmp_path, suffix, capfd):
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(VideoError) as caught:
        VideoWriter(tmp_path / "file" / f"film{suffix}", fps=25, size=(WIDTH, HEIGHT))
    assert "\n" not in str(caught.value)
    assert "cannot write" in str(caught.value)
    (tmp_path / f"taken{suffix}").mkdir()
    with pytest.raises(VideoError, match="folder"):
        VideoWriter(tmp_path / f"taken{suffix}", fps=25, size=(WIDTH, HEIGHT))
    assert capfd.readouterr() == ("", "")


def test_bad_numbers_are_refused(tmp_path):
    for fps in (0.0, -1.0, float("nan"), 1000.0, "fast"):
        with pytest.raises(OptionError, match="fps"):
            VideoWriter(tmp_path / "film.mp4", fps=fps, size=(WIDTH, HEIGHT))
    for size in ((0, 64), (96.0, 64), (96, -2)):
        with pytest.raises(OptionError):
            VideoWriter(tmp_path / "film.mp4", fps=25, size=size)
    with pytest.raises(VideoError, match="50"):
        VideoWriter(tmp_path / "film.gif", fps=60, size=(WIDTH, HEIGHT))
    assert names(tmp_path) == []


def test_closing_twice_is_fine_and_writing_after_it_is_not(tmp_path):
    video = VideoWriter(tmp_path / "film.mp4", fps=25, size=(WIDTH, HEIGHT))
    video.write(frame(COLORS[0]))
    assert not (tmp_path / "film.mp4").exists()
    video.close()
    video.close()
    assert (tmp_path / "film.mp4").exists()
    with pytest.raises(StateError, match="closed"):
        video.write(frame(COLORS[0]))


def test_a_film_that_lost_frames_is_refused(tmp_path, monkeypatch):
    from taichi_soft.render import video as module

    monkeypatch.setattr(module, "measure", lambda path: (3, {(WIDTH, HEIGHT)}))
    with pytest.raises(VideoError, match="3 frames"):
        film(tmp_path / "film.gif", [frame(color) for color in COLORS])
    assert names(tmp_path) == []
