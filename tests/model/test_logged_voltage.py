"""Smoothing of the logged voltage between its jumps."""

import numpy as np
import pytest

from identification.arrays import Array
from identification.model.logged_voltage import smooth_voltage, voltage_step

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


@pytest.mark.parametrize("step", [0.1, 0.5])
@pytest.mark.parametrize("height", [0.0, 3.0])
def test_coarse_rounding_is_reduced_and_what_is_left_has_its_size(
    step: float, height: float
) -> None:
    """Half of the rounding is removed; the random series is as large as the error that is left."""
    true = 10.0 * np.sin(TIME / 200.0) + height * np.sign(np.sin(TIME / 80.0))
    logged = step * np.round(true / step)
    smooth, left = smooth_voltage(logged)
    assert voltage_step(logged) == pytest.approx(step, rel=1e-6)
    assert np.std(smooth - true) < 0.5 * step / np.sqrt(12.0)
    assert 0.5 < np.std(left) / np.std(smooth - true) < 2.0
    assert np.abs(smooth - logged).max() < 0.5001 * step


def test_levels_of_a_generator_are_no_rounding() -> None:
    """Stairs, ramps of whole steps, and normal numbers with sixteen digits."""
    stairs = np.repeat([6.0, 12.0, 24.0, -12.0, -24.0, 0.0, 10.0, 18.0, 2.0, 14.0], 300)
    ramps = np.clip(np.abs(TIME % 1000 - 500) / 10.0, 10.0, 40.0)
    for logged in (stairs, ramps, RNG.standard_normal(ROWS)):
        assert voltage_step(logged) == 0.0


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
