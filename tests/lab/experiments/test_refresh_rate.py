"""Drawing at 40 FPS: the timed parts, and verdicts for given times. No test asserts a duration."""

import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import EXPERIMENTS, Verdict

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

NAME = "refresh-rate"


def test_every_part_of_every_frame_is_timed_alone():
    numbers = quick_results(NAME).one()
    assert EXPERIMENTS[NAME].is_timing
    assert {len(numbers[key]) for key in ("step", "read", "draw")} == {40}
    assert min(min(numbers[key]) for key in ("step", "read", "draw")) > 0
    assert numbers["tets"] == 968


def test_the_verdict_follows_the_share_of_the_time_at_40_hz():
    results = quick_results(NAME)

    def timed(read, draw):
        def change(_, numbers):
            return {**numbers, "step": [1e-3] * 3, "read": [read] * 3, "draw": [draw] * 3}

        return altered(results, change)

    assert verdicts(NAME, timed(1e-5, 1e-3)) == {NAME: Verdict.AGREES}  # 4 % of the time
    assert verdicts(NAME, timed(1e-5, 1e-2)) == {NAME: Verdict.UNKNOWN}
    assert verdicts(NAME, timed(5e-3, 1e-2)) == {NAME: Verdict.DIFFERS}
    told = findings(NAME, timed(1e-4, 1e-2))[NAME]
    assert "reading the positions takes 0.40% of the time" in told.measured
    assert "by this processor takes 40%: 10 ms a frame, beside 1 ms" in told.measured
    assert "graphics card" in told.why
