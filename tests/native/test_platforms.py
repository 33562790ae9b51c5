"""Recorded games have the kept bits on every platform that can be played here, which `platforms.py` lists."""

import json

import pytest
from platforms import RUNNERS, played, player_for
from test_kept_bits import KEPT

PLAYED = ("heap", "held", "laws")  # `make test-platforms` plays all of them
TARGETS = ",".join(dict.fromkeys(each.platform for each in RUNNERS.values()))


@pytest.fixture(scope="session")
def program(tmp_path_factory):
    """A function that builds the player of games for a platform, once, and returns its path."""
    made = {}

    def built(platform):
        if platform not in made:
            made[platform] = player_for(platform, tmp_path_factory.mktemp(platform))
        return made[platform]

    return built


@pytest.mark.parametrize("name", PLAYED)
@pytest.mark.parametrize("label", RUNNERS)
def test_a_game_has_the_same_bits_on_another_platform(label, name, export, program):
    runner = RUNNERS[label]
    if not runner.is_here:
        pytest.skip(f"needs {' and '.join(runner.needs)}: {runner.source}")
    found = played(name, runner, program(runner.platform), export(name, "--for", TARGETS))
    assert found == json.loads(KEPT.read_text())[name]
