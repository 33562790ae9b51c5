"""The GDNative library for Godot, and the messages that scripts in Godot send to a test."""

import json
import os
import runpy
import subprocess

import pytest
from native_build import ROOT

GODOT = ROOT / "engine_adapter" / "godot"
SCRIPTS = ROOT / "tests" / "native" / "godot"

files_of = runpy.run_path(str(GODOT / "write_project.py"))["files_of"]


def build(folder, native, world):
    """Build it on the library in the folder `native`, and with a world file to pack. Returns: its folder."""
    settings = [f"-DTAICHI_SOFT_DIR={native}", f"-DTAICHI_SOFT_GODOT_WORLD={world}"]
    if "GODOT_HEADERS" in os.environ:
        settings.append(f"-DGODOT_HEADERS={os.environ['GODOT_HEADERS']}")
    done = subprocess.run(
        ["cmake", "-S", str(GODOT), "-B", str(folder), *settings], capture_output=True, text=True
    )
    if "Godot's headers cannot be fetched" in " ".join(done.stderr.split()):
        pytest.skip("needs Godot's headers, from static.crates.io or in the folder $GODOT_HEADERS")
    assert done.returncode == 0, done.stderr
    done = subprocess.run(["cmake", "--build", str(folder)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stdout + done.stderr
    return folder / "bin"


def told(text):
    """Return the values that a script printed as JSON, by name."""
    rows = [json.loads(row[5:]) for row in text.splitlines() if row.startswith("JSON ")]
    return {row["name"]: row["value"] for row in rows}
