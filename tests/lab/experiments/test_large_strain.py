"""Strains of over 100 %: closed forms of a bar with nu = 0, and verdicts that depend on the numbers."""

import numpy as np
import pytest
from quick import altered, findings, quick_results, verdicts

from lab.experiments import Verdict
from lab.experiments.large_strain import reach, width_limit

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

NAME = "large-strain"


def test_with_nu_0_the_bar_stretches_as_far_as_one_likes():
    """Eq. 6.7: F = E A (s + s^2 / 2); the volume grows with the length."""
    numbers = quick_results(NAME).one(poisson=0.0)
    s = np.array(numbers["stretch"])
    assert s[-1] == pytest.approx(1.2)
    np.testing.assert_allclose(numbers["force"], 1 + s / 2, rtol=1e-7)
    np.testing.assert_allclose(numbers["volume"], 1 + s, rtol=1e-7)


def test_with_nu_04_it_gives_way_before_a_free_bar_has_no_width():
    numbers = quick_results(NAME).one(poisson=0.4)
    limit = width_limit(0.4)
    assert 1 - 0.4 * (2 * limit + limit**2) == pytest.approx(0.0, abs=1e-12)
    assert 0.2 < reach(numbers) < limit < 1.0


def test_inverted_tetrahedra_do_not_count():
    assert reach({"stretch": [0.5, 1.0, 1.2], "smallest": [0.9, 0.2, -0.1]}) == 1.0
    assert reach({"stretch": [], "smallest": []}) == 0.0


def test_the_verdict_follows_how_far_each_nu_goes():
    results = quick_results(NAME)
    assert verdicts(NAME, results) == {NAME: Verdict.PARTLY}
    assert "does not hold for nu = 0.4" in findings(NAME, results)[NAME].why

    def all_as(poisson):
        numbers = results.one(poisson=poisson)
        return verdicts(NAME, altered(results, lambda *_: numbers))

    assert all_as(0.0) == {NAME: Verdict.AGREES}
    assert all_as(0.4) == {NAME: Verdict.DIFFERS}
