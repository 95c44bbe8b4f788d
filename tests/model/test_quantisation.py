"""Quantisation step of a logged signal."""

import numpy as np
import pytest

from identification.model.quantisation import step_of


@pytest.mark.parametrize("step", [0.2, 20.0, 2.0 * np.pi / 60.0])
def test_the_step_of_a_converter_is_found(step: float) -> None:
    """One level never occurs, and one sample in 200 lies between two levels."""
    rng = np.random.default_rng(3)
    levels = np.round(15.0 * np.sin(np.arange(4000) / 90.0) + rng.standard_normal(4000))
    levels = levels[levels != 4.0]
    levels[::200] += 0.5

    assert step_of(step * levels) == pytest.approx(step, rel=1e-6)


def test_noise_and_a_constant_have_no_step() -> None:
    """Differences of normal numbers have no common divisor."""
    rng = np.random.default_rng(4)

    assert step_of(rng.standard_normal(2000)) is None
    assert step_of(np.full(100, 3.0)) is None
