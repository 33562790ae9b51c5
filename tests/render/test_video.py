"""Films: written, read back with OpenCV, refused, cleaned up; also where the process is killed."""

import os
import signal
import subprocess
import sys
import time
import weakref
from pathlib import Path

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
    with pytest.raises(VideoError, match=r"frame 1.*uint8"):
        film(tmp_path / "film.mp4", [frame(COLORS[0]), bad])
    assert names(tmp_path) == []


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif", ".png"])
def test_an_exception_inside_leaves_the_old_film(tmp_path, suffix):
    path = tmp_path / f"film{suffix}"
    kept = tmp_path / "film_0000.png" if suffix == ".png" else path
    kept.write_bytes(b"old")
    frames = (frame(COLORS[i]) for i in range(len(COLORS) + 1))  # the last frame raises an error
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
    from taichi_soft.render import containers as module

    monkeypatch.setattr(module.Gif, "measure", lambda self: (3, {(WIDTH, HEIGHT)}))
    with pytest.raises(VideoError, match="3 frames"):
        film(tmp_path / "film.gif", [frame(color) for color in COLORS])
    assert names(tmp_path) == []


def boxes(data):
    """Names of the outermost boxes of an MP4 file (ISO 14496-12): each begins with its length and name."""
    found = []
    while data:
        length = int.from_bytes(data[:4], "big")
        found.append(data[4:8])
        data = data[length:]
    return found


def test_films_are_of_the_kinds_that_browsers_play(tmp_path):
    """H.264 at 4:2:0 with its index first, so that a page shows it while it loads; VP9."""
    for suffix in (".mp4", ".webm"):
        film(tmp_path / f"film{suffix}", [frame(color) for color in COLORS])
    names_of = {}
    for suffix in (".mp4", ".webm"):
        number = int(cv2.VideoCapture(str(tmp_path / f"film{suffix}")).get(cv2.CAP_PROP_FOURCC))
        names_of[suffix] = number.to_bytes(4, "little").lower()
    assert names_of == {".mp4": b"h264", ".webm": b"vp90"} or names_of == {".mp4": b"avc1", ".webm": b"vp09"}
    data = (tmp_path / "film.mp4").read_bytes()
    order = boxes(data)
    assert order.index(b"moov") < order.index(b"mdat")
    # The configuration (ISO 14496-15) names the profile: 100 (High) is 4:2:0, 244 is 4:4:4.
    profile = data[data.index(b"avcC") + 5]
    assert profile in (66, 77, 100)


def test_a_gif_may_have_an_odd_size(tmp_path):
    with VideoWriter(tmp_path / "film.gif", fps=25, size=(33, 21)) as video:
        video.write(frame(COLORS[0], 33, 21))
    assert read(tmp_path / "film.gif")[0][0].shape == (21, 33, 3)


def test_the_colors_of_a_photograph_survive(tmp_path):
    """A smooth picture: no channel is off by more than 6 of 255 on average, in no kind of film."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    picture = np.stack([60 + x, 200 - y, 90 + (x + y) // 2], axis=-1).astype(np.uint8)
    for suffix in (".mp4", ".webm", ".gif"):
        film(tmp_path / f"film{suffix}", [picture] * 3)
        for seen in read(tmp_path / f"film{suffix}")[0]:
            assert np.abs(seen.astype(int) - picture).mean(axis=(0, 1)).max() < 6


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_no_frame_stays_in_memory(tmp_path, suffix):
    with VideoWriter(tmp_path / f"film{suffix}", fps=25, size=(WIDTH, HEIGHT)) as video:
        for color in COLORS:
            picture = frame(color)
            video.write(picture)
            gone = weakref.ref(picture)
            del picture
            assert gone() is None


ENDLESS = """
import sys
import numpy as np
from taichi_soft.render import VideoWriter
with VideoWriter(sys.argv[1], fps=25, size=(96, 64)) as video:
    while True:
        video.write(np.full((64, 96, 3), video.count % 200, np.uint8))
        if video.count == 30:
            print("running", flush=True)
"""


def processes_that_name(folder):
    """Numbers of processes with the folder in their command, of Linux."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            command = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if os.fsencode(folder) in command and b"ffmpeg" in command.split(b"\0")[0]:
            found.append(int(entry.name))
    return found


def encoder_of(folder):
    """Number of the process that encodes a film there. Linux shows its command a moment after its start."""
    end = time.monotonic() + 20
    while not (found := processes_that_name(folder)) and time.monotonic() < end:
        time.sleep(0.01)
    return found[0]


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize(
    "suffix",
    [
        ".mp4",
        pytest.param(".webm", marks=pytest.mark.soak),
        pytest.param(".gif", marks=pytest.mark.soak),
        ".png",
    ],
)
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_killed_film_leaves_no_process_and_what_it_left_is_removed_by_the_next(tmp_path, suffix, number):
    path = tmp_path / f"film{suffix}"
    child = subprocess.Popen(
        [sys.executable, "-P", "-c", ENDLESS, str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=dict(os.environ, PYTHONPATH=str(Path(__file__).parents[2])),
    )
    assert child.stdout.readline() == b"running\n"
    assert bool(processes_that_name(tmp_path)) == (suffix != ".png")
    child.send_signal(number)
    child.wait(20)
    child.stdout.close()
    end = time.monotonic() + 20
    while processes_that_name(tmp_path) and time.monotonic() < end:
        time.sleep(0.05)
    assert processes_that_name(tmp_path) == []
    assert [name for name in names(tmp_path) if not name.startswith(".")] == []
    if number == signal.SIGINT:  # an exception like any other
        assert names(tmp_path) == []
    film(tmp_path / "next.mp4", [frame(COLORS[0])])
    assert names(tmp_path) == ["next.mp4"]


def test_films_of_one_name_that_are_made_at_once_do_not_disturb_each_other(tmp_path):
    first, second = (VideoWriter(tmp_path / "film.mp4", fps=25, size=(WIDTH, HEIGHT)) for _ in range(2))
    for count, video in ((2, second), (5, first)):
        for color in COLORS[:count]:
            video.write(frame(color))
        video.close()
        assert len(read(tmp_path / "film.mp4")[0]) == count
    assert names(tmp_path) == ["film.mp4"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs a program that always fails")
@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_an_ffmpeg_that_fails_is_one_line_and_no_file(tmp_path, suffix, monkeypatch, capfd):
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/bin/false")
    with pytest.raises(VideoError, match="exit code 1"):
        film(tmp_path / f"film{suffix}", [frame(COLORS[0])] * 50)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "nowhere"))
    with pytest.raises(VideoError, match="cannot start"):
        film(tmp_path / f"film{suffix}", [frame(COLORS[0])])
    assert names(tmp_path) == []
    assert capfd.readouterr() == ("", "")


def write_many(video):
    """Write more data than a pipe can buffer."""
    for _ in range(500):
        video.write(frame(COLORS[1]))


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_a_film_is_encoded_at_the_priority_of_the_process_that_makes_it(tmp_path):
    """A busy machine gives almost no time to a process of low priority, or to a session of low priority."""
    with VideoWriter(tmp_path / "film.mp4", fps=25, size=(WIDTH, HEIGHT)) as video:
        video.write(frame(COLORS[0]))
        child = encoder_of(tmp_path)
        assert os.getpriority(os.PRIO_PROCESS, child) == os.getpriority(os.PRIO_PROCESS, 0)
        session = Path(f"/proc/{child}/autogroup")
        if session.exists():  # the kernel may be built without
            assert session.read_text().endswith("nice 0\n")


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_a_crash_of_ffmpeg_in_the_middle_is_an_error_and_no_file(tmp_path):
    video = VideoWriter(tmp_path / "film.mp4", fps=25, size=(WIDTH, HEIGHT))
    video.write(frame(COLORS[0]))
    child = encoder_of(tmp_path)
    os.kill(child, signal.SIGSEGV)
    with pytest.raises(VideoError, match="ffmpeg ended"):
        write_many(video)
    assert names(tmp_path) == []
    with pytest.raises(StateError, match="closed"):
        video.write(frame(COLORS[1]))


def test_without_its_package_a_film_is_refused_with_the_way_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr("taichi_soft.core.extras.find_spec", lambda name: None)
    for suffix in (".mp4", ".webm", ".gif"):
        with pytest.raises(OptionError, match=r"imageio-ffmpeg.*pip install 'taichi-soft\[film\]'"):
            VideoWriter(tmp_path / f"film{suffix}", fps=25, size=(WIDTH, HEIGHT))
    assert names(tmp_path) == []
    film(tmp_path / "film.png", [frame(COLORS[0])])
    assert names(tmp_path) == ["film_0000.png"]


def test_without_opencv_pictures_are_refused_with_the_way_to_get_it():
    code = """
import sys
from importlib.abc import MetaPathFinder

class Missing(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == "cv2":
            raise ModuleNotFoundError("No module named 'cv2'", name="cv2")

sys.meta_path.insert(0, Missing())
import taichi_soft
try:
    import taichi_soft.render
except taichi_soft.OptionError as error:
    print(error)
"""
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        env=dict(os.environ, PYTHONPATH=str(Path(__file__).parents[2])),
    )
    assert done.stdout == (
        "rendering needs opencv-python-headless, not installed here: run pip install 'taichi-soft[film]'\n"
    ), done.stderr
