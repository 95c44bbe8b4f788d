"""Smoothing of the logged voltage between its jumps."""

import numpy as np
import pytest

from identification.arrays import Array
from identification.model.logged_voltage import smooth_voltage

ROWS = 3000
TIME = np.arange(ROWS)
RNG = np.random.default_rng(3)

SMOOTH = {
    "sine": 20.0 * np.sin(TIME / 40.0),
    "triangle": np.abs(TIME % 400 - 200) / 10.0,
    "constant": np.full(ROWS, 12.0),
}
STEPPED = {
    "steps": np.repeat(RNG.uniform(-20.0, 20.0, ROWS // 50), 50),
    "sine with steps": 8.0 * np.sin(TIME / 90.0) + np.repeat(RNG.uniform(-3, 3, ROWS // 50), 50),
}


@pytest.mark.parametrize("name", [*SMOOTH, *STEPPED])
def test_noise_is_reduced_between_jumps(name: str) -> None:
    """At most half of the noise remains where some twenty samples vary smoothly."""
    true = (SMOOTH | STEPPED)[name]
    logged = true + 0.05 * np.random.default_rng(1).standard_normal(ROWS)
    assert np.std(smooth_voltage(logged)[0] - true) < 0.5 * np.std(logged - true)


@pytest.mark.parametrize("name", [*SMOOTH, *STEPPED])
def test_a_voltage_without_noise_stays(name: str) -> None:
    """What is removed of an exact voltage is rounding, with the jumps and at both ends."""
    true = (SMOOTH | STEPPED)[name]
    np.testing.assert_allclose(smooth_voltage(true)[0], true, atol=1e-6)


@pytest.mark.parametrize("name", list(STEPPED))
def test_jumps_stay_where_they_are(name: str) -> None:
    """The samples on both sides of a jump of many standard deviations are not averaged."""
    true = STEPPED[name]
    logged = true + 0.05 * np.random.default_rng(2).standard_normal(ROWS)
    moved = np.abs(smooth_voltage(logged)[0] - true)
    jumps = np.flatnonzero(np.abs(np.diff(true)) > 1.0)
    assert np.max(moved[np.concatenate([jumps, jumps + 1])]) < 0.3


@pytest.mark.parametrize("logged", [np.array([1.0, 2.0]), np.array([3.0, 1.0, 2.0]), np.zeros(5)])
def test_a_few_samples_give_a_finite_voltage(logged: Array) -> None:
    """Records may have two samples."""
    assert np.all(np.isfinite(smooth_voltage(logged)[0]))
