"""What a game gets: the installed folder alone builds the sample and plays it, with the licences beside."""

import os
import shutil
import subprocess


def test_the_sample_is_built_and_played_with_what_is_shipped_alone(native, export, tmp_path):
    ship = tmp_path / "ship"
    done = subprocess.run(["cmake", "--install", native, "--prefix", ship], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    names = {str(each.relative_to(ship)) for each in ship.rglob("*") if each.is_file()}
    needed = {"libtaichi_soft.so", "libtaichi_c_api.so", "runtime_x64.bc", "LICENSE", "LICENSE-taichi"}
    assert needed | {"include/taichi_soft.h", "include/taichi_soft.hpp", "csharp/TaichiSoft.cs"} <= names
    assert "Apache License" in (ship / "LICENSE-taichi").read_text()
    program = ship / "own"
    command = ["g++", "-std=c++17", "-Wall", "-Werror", str(ship / "sample" / "game.cpp"), "-o", str(program)]
    command += [f"-I{ship / 'include'}", f"-L{ship}", "-ltaichi_soft", "-Wl,-rpath,$ORIGIN"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    folder = shutil.copytree(export("heap"), ship / "game.softworld")
    environment = {name: value for name, value in os.environ.items() if name != "TI_LIB_DIR"}
    done = subprocess.run([program, folder], capture_output=True, text=True, env=environment, cwd="/")
    assert done.returncode == 1
    assert done.stderr == "error: nothing of that kind is called ball\n"  # it reads the file, of another game
