"""The native library and its build for Godot, built once for all tests."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # modules that the tests of this folder share

import godot_build  # noqa: E402
from godot4_host import GODOT, VERSIONS, Host  # noqa: E402
from native_build import ROOT, build  # noqa: E402

from taichi_soft.bodies.capacity import LEAST  # noqa: E402

OWN = dict(LEAST)  # before tests share theirs


@pytest.fixture(autouse=True)
def own_room():
    """Give worlds the capacities of their exports. Kernels for other capacities may round differently."""
    kept = dict(LEAST)
    LEAST.update(OWN)
    yield
    LEAST.update(kept)


@pytest.fixture(scope="session")
def native(tmp_path_factory):
    """Return the folder of the library."""
    return build(tmp_path_factory.mktemp("native"))


@pytest.fixture(scope="session")
def play(native):
    """Return the program that plays recorded games."""
    return native / "play"


@pytest.fixture(scope="session")
def export(tmp_path_factory):
    """Return a function that exports a scene once, in a separate process, and returns its folder."""
    made = {}

    def exported(name, *options):
        key = (name, *options)
        if key not in made:
            folder = tmp_path_factory.mktemp("worlds") / f"{name}.softworld"
            command = ["-m", "taichi_soft", "export", f"{HERE / 'scenes.py'}:{name}", "--out", str(folder)]
            done = subprocess.run([sys.executable, *command, *options], capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
            made[key] = folder
        return made[key]

    return exported


@pytest.fixture(scope="session")
def godot4(native, tmp_path_factory):
    """Folder in which cmake has built the library and the stand-in."""
    folder = tmp_path_factory.mktemp("godot4")
    settings = ["-DTAICHI_SOFT_GODOT=4", "-DTAICHI_SOFT_TESTS=ON", f"-DTAICHI_SOFT_DIR={native}"]
    if "GODOT4_HEADERS" in os.environ:
        settings.append(f"-DGODOT4_HEADERS={os.environ['GODOT4_HEADERS']}")
    done = subprocess.run(
        ["cmake", "-S", str(GODOT), "-B", str(folder), *settings], capture_output=True, text=True
    )
    if "Godot's headers cannot be fetched" in " ".join(done.stderr.split()):
        pytest.skip("needs Godot's headers, from static.crates.io or in the folder $GODOT4_HEADERS")
    assert done.returncode == 0, done.stderr
    done = subprocess.run(["cmake", "--build", str(folder)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def interfaces(godot4):
    """Folders of Godot's header and of its extension_api.json, by version."""
    found = {version: godot4 / "gdextension-api-0.2.2" / "versions" / version / "res" for version in VERSIONS}
    if not all(folder.exists() for folder in found.values()):
        pytest.skip("needs Godot's headers of each version, from static.crates.io")
    return found


@pytest.fixture(scope="module")
def api(interfaces):
    """Return Godot's description of its interface for extensions, by version."""
    return {
        version: json.loads((folder / "extension_api.json").read_text(encoding="utf-8"))
        for version, folder in interfaces.items()
    }


@pytest.fixture
def host(godot4):
    """Check that no object of Godot's is left after the library was unloaded."""
    host = Host(godot4)
    yield host
    assert host.end() == ["unregistered at 2", "left 0"]


@pytest.fixture(scope="session")
def engine():
    """The program: Godot without a window."""
    for name in ("godot3-server", "godot3-runner"):
        if shutil.which(name) is not None:
            return shutil.which(name)
    pytest.skip("needs godot3-server: apt-get install godot3-server")


@pytest.fixture(scope="session")
def demo_world(tmp_path_factory):
    """The world file of the demo for Godot."""
    folder = tmp_path_factory.mktemp("demo_world")
    for path in (godot_build.GODOT / "demo" / "world.py", ROOT / "assets" / "elephant.glb"):
        shutil.copy(path, folder)
    command = ["export", str(folder / "world.py"), "--axes", "y-up", "--out", str(folder / "demo.softworld")]
    done = subprocess.run([sys.executable, "-m", "taichi_soft", *command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "demo.softworld"


@pytest.fixture(scope="session")
def libraries(native, demo_world, tmp_path_factory):
    """Folder of the GDNative library, within that of its build."""
    return godot_build.build(tmp_path_factory.mktemp("godot"), native, demo_world)
