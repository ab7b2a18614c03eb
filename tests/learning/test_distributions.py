"""Draws of distributions, against SciPy's."""

import numpy as np
import pytest
from scipy import stats

from finger_pin.exceptions import InputError
from finger_pin.learning.distributions import Choice, LogUniform, Normal, Uniform

EXPECTED = {
    "uniform": (Uniform(-1.0, 3.0), stats.uniform(-1.0, 4.0)),
    "log-uniform": (LogUniform(1e-3, 10.0), stats.loguniform(1e-3, 10.0)),
    "normal": (Normal(0.3, 2.0), stats.norm(0.3, 2.0)),
    "cut normal": (Normal(0.3, 2.0, low=0.0), stats.truncnorm(-0.15, np.inf, 0.3, 2.0)),
    "normal, of which little is left": (Normal(0.3, 2.0, 0.299, 0.3005), stats.truncnorm(-5e-4, 2.5e-4, 0.3, 2.0)),
}


@pytest.mark.parametrize(("distribution", "expected"), EXPECTED.values(), ids=EXPECTED)
def test_draws_have_the_distribution_that_scipy_has_under_the_name(distribution, expected):
    rng = np.random.default_rng(5)
    assert stats.kstest([distribution.draw(rng) for _ in range(4000)], expected.cdf).pvalue > 0.01


@pytest.mark.parametrize("distribution", [Normal(1.0, 0.0, 0.5, 2.0), Normal(1.0, 0.5, 1.0, 1.0)])
def test_a_normal_distribution_without_width_is_its_mean(distribution):
    assert distribution.draw(np.random.default_rng(1)) == 1.0


def test_a_choice_is_as_often_each_value():
    rng = np.random.default_rng(2)
    drawn = [Choice(("a", "b", "c")).draw(rng) for _ in range(3000)]
    assert stats.chisquare([drawn.count(each) for each in "abc"]).pvalue > 0.01


@pytest.mark.parametrize(
    ("make", "entry"),
    [
        (lambda: Uniform(2.0, 1.0), "Uniform"),
        (lambda: LogUniform(0.0, 1.0), "LogUniform.low"),
        (lambda: Normal(np.nan, 1.0), "Normal"),
        (lambda: Normal(0.0, -1.0), "Normal"),
        (lambda: Normal(0.0, 1.0, 0.5, 2.0), "Normal.mean"),
        (lambda: Choice("abc"), "Choice.values"),
        (lambda: Choice(()), "Choice.values"),
    ],
)
def test_what_is_no_distribution_is_refused_by_its_name(make, entry):
    with pytest.raises(InputError, match=rf"^{entry}\b"):
        make()
