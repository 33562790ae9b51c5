"""Worlds whose kernels are linked into a game, for platforms that forbid loading code."""

import subprocess

import pytest
from library import in_process
from native_build import ROOT, build

pytestmark = pytest.mark.soak

PROGRAM = """
#include <stdio.h>
#include <stdlib.h>

#include "taichi_soft.h"

extern const ts_linked_kernel taichi_soft_kernels_heap[], taichi_soft_kernels_free[];

int main(int count, char** arguments) {
  FILE* file = fopen(arguments[1], "rb");
  char* world = malloc(1 << 24);
  const size_t size = fread(world, 1, 1 << 24, file);
  ts_scene scene = 0, other = 0;
  ts_world first = 0;
  uint64_t hash = 0;
  if (ts_scene_load_linked(world, size, taichi_soft_kernels_heap, &scene) != TS_OK) return 1;
  const ts_result refused = ts_scene_load_linked(world, size, taichi_soft_kernels_free, &other);
  printf("%d %s\\n", refused, ts_last_error());
  free(world);
  ts_world_create(scene, &first);
  for (int i = 0; i < 100; ++i) ts_world_step(first, 1.0 / 64.0, 0);
  ts_world_hash(first, &hash);
  printf("%llu\\n", (unsigned long long)hash);
  return count - 2;
}
"""

OPENED = """
world = soft.create(soft.load(arguments[0]))
for _ in range(100):
    soft.step(world)
print(json.dumps(soft.hash(world)))
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Folder of the library as an archive."""
    return build(tmp_path_factory.mktemp("archive"), "-DTAICHI_SOFT_STATIC=ON", targets=["taichi_soft"])


@pytest.mark.parametrize("library", ["opened", "linked"])
def test_two_worlds_are_linked_into_a_game_and_move_as_those_that_are_opened(
    library, native, request, export, tmp_path
):
    worlds = {name: export(name, "--static", "--for", "linux-x64") for name in ("heap", "free")}
    source, program = tmp_path / "linked.c", tmp_path / "linked"
    source.write_text(PROGRAM)
    include = ROOT / "engine_adapter" / "native" / "include"
    objects = [folder / "kernels" / "linux-x64.o" for folder in worlds.values()]
    options = ["-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{include}"]
    if library == "opened":
        options += [f"-L{native}", "-ltaichi_soft", f"-Wl,-rpath,{native}"]
    else:
        folder = request.getfixturevalue("archive")
        assert not list(folder.glob("*.so"))
        options += [
            "-DTAICHI_SOFT_STATIC",
            f"-L{folder}",
            "-ltaichi_soft",
            "-lstdc++",
            "-lm",
            "-lpthread",
            "-ldl",
        ]
    command = ["gcc", source, *objects, *options, "-o", program]
    done = subprocess.run([str(each) for each in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([program, worlds["heap"] / "world.tsw"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    refused, hash_of_linked = done.stdout.splitlines()
    assert refused == "-4 the kernels belong to another export: export the world again, and ship both"
    assert int(hash_of_linked) == in_process(native, OPENED, export("heap"))
