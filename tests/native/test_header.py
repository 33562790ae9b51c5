"""The header for C++: ownership of its objects, and their release."""

import subprocess

import pytest
from native_build import ROOT

pytestmark = [pytest.mark.soak, pytest.mark.guard]

PROGRAM = """
#include <cstdio>

#include "taichi_soft.hpp"

int main(int, char** arguments) {
  taichi_soft::Scene scene(arguments[1]);
  taichi_soft::World world = scene.create();
  const auto is_held = [&](int32_t number) {
    ts_grab found = 0;
    taichi_soft::check(ts_world_get_grab(world.handle(), number, &found));
    return int(found != 0);
  };
  const auto hit = world.closest({0.0, 0.0, 0.9});
  const auto before = world.snapshot();
  taichi_soft::Grab hand = world.grab(hit);
  world.step(1.0 / 64.0);
  world.restore(before);
  std::printf("%d ", is_held(0));
  hand = world.grab(hit);  // has the number of the one before
  std::printf("%d ", is_held(0));
  taichi_soft::Grab other = world.grab(hit);
  hand = std::move(other);  // lets go of the first at once
  std::printf("%d %d ", is_held(0), is_held(1));
  hand = taichi_soft::Grab();
  std::printf("%d ", is_held(1));
  { world.grab(hit).forget(); }
  std::printf("%d\\n", is_held(0));
}
"""


def test_a_hand_lets_go_of_its_own_grab_and_of_no_later_one(native, export, tmp_path):
    source, program = tmp_path / "hands.cpp", tmp_path / "hands"
    source.write_text(PROGRAM)
    include = ROOT / "engine_adapter" / "native" / "include"
    options = ["-std=c++17", "-Wall", "-Wextra", "-Werror", f"-I{include}", f"-L{native}"]
    options += ["-ltaichi_soft", f"-Wl,-rpath,{native}", "-o", program]
    done = subprocess.run(["g++", source, *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([program, export("heap")], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "0 1 0 1 0 1\n"), done.stderr
