"""Games have the bits that are kept in the repository: on every machine, and from one version to the next.

Whoever changes how bodies move has them written anew, which shows in the change:

    TAICHI_SOFT_KEEP_BITS=1 .venv/bin/python -m pytest tests/native/test_kept_bits.py
"""

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
import random_play
from games import Player, digests
from scenes import GAMES
from test_same_bits import drawn

pytestmark = pytest.mark.soak

KEPT = Path(__file__).with_name("kept_bits.json")

OLD_PROCESSOR = {
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": (
        "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4 AVX2 FMA3 X86_V3"
    ),
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA",
}
"""What NumPy and the C library look at to choose their code."""

PRINT_BITS = (
    "import sys; sys.path[:0] = {path!r}; from test_kept_bits import bits_of; print(bits_of({name!r}))"
)


def told_by(name):
    """Return the output of a game in lines.

    The game "anything" also uses features that cannot be exported.
    """
    if name == "anything":
        return map(str, random_play.play(*random_play.make_world(), ticks=600, seed=0))
    make, game = GAMES[name]
    world = make()
    return Player(world, drawn(world)).play(list(game()))


def bits_of(name):
    """Return the hashes of a game's output."""
    return digests(told_by(name))


@pytest.mark.guard
@pytest.mark.parametrize("name", [*GAMES, "anything"])
def test_a_game_has_the_bits_that_are_kept(name):
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    found = bits_of(name)
    if os.environ.get("TAICHI_SOFT_KEEP_BITS") == "1":
        KEPT.write_text(json.dumps({**kept, name: found}, indent=1, sort_keys=True) + "\n")
    else:
        assert found == kept[name]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the names are those of x86")
@pytest.mark.parametrize("name", ["held", "anything"])
def test_a_world_has_the_same_bits_where_numpy_takes_code_for_an_older_processor(name):
    program = PRINT_BITS.format(path=sys.path, name=name)
    done = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, **OLD_PROCESSOR}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(json.loads(KEPT.read_text())[name])
