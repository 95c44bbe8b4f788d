"""Step responses for plotting."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.speed_loop import feedback_metrics, step_curves

MOTOR: dict[str, NDArray[np.float64] | float] = {
    "Ra25": np.array([0.59, 0.6, 0.65]),
    "alpha_Ra": 0.004,
    "Kt25": 0.071,
    "alpha_Kt": -0.002,
    "J": np.array([0.01, 0.012, 0.009]),
    "b": 0.1,
    "L": 0.5,
}


def test_curve_starts_at_rest_and_ends_at_the_steady_state() -> None:
    """Speed 0 at time 0; at the end each draw is within 2 % of its final value."""
    for controller in ("P:1", "PI:1,2"):
        for curve, entry in zip(
            step_curves(MOTOR, [25.0, 125.0], [controller]),
            feedback_metrics(MOTOR, [25.0, 125.0], [controller]),
            strict=True,
        ):
            assert curve.temperature_degC == entry["temperature_degC"]
            assert curve.median[0] == pytest.approx(0, abs=1e-12)
            assert curve.median[-1] == pytest.approx(entry["steady_state"]["median"], rel=0.02)
            assert curve.time[-1] > entry["settling_time_s"]["median"]


def test_band_encloses_the_median() -> None:
    """Quantiles are ordered at every instant, and the draws differ."""
    (curve,) = step_curves(MOTOR, [25.0], ["P:1"])

    assert (curve.q05 <= curve.median).all()
    assert (curve.median <= curve.q95).all()
    assert (curve.q95 - curve.q05)[-1] > 0


def test_temperatures_of_a_controller_share_their_instants() -> None:
    """Curves of one plot have a common time axis of the requested length."""
    cold, hot = step_curves(MOTOR, [25.0, 125.0], ["P:1"], n_time=50)

    np.testing.assert_array_equal(cold.time, hot.time)
    assert cold.time.shape == cold.median.shape == (50,)


def test_unstable_loop_is_drawn_while_it_grows() -> None:
    """All numbers are finite, and the amplitude at the end exceeds that at the start."""
    (curve,) = step_curves(MOTOR, [25.0], ["PI:1,1e5"])

    assert np.isfinite([curve.time, curve.median, curve.q05, curve.q95]).all()
    assert np.abs(curve.median[-100:]).max() > 3 * np.abs(curve.median[:100]).max()


def test_many_draws_are_thinned_evenly() -> None:
    """A thousand equal draws give the same curve as a single one."""
    many = {name: np.resize(np.atleast_1d(value)[:1], 1000) for name, value in MOTOR.items()}
    single = {name: np.atleast_1d(value)[:1] for name, value in MOTOR.items()}

    (thinned,), (alone,) = (step_curves(x, [25.0], ["P:1"]) for x in (many, single))

    np.testing.assert_allclose(thinned.median, alone.median, rtol=1e-12)
