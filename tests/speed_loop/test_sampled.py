"""Characteristics of sampled responses: textbook values, convergence order, undefined values."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.speed_loop.metrics import StepMetrics
from identification.speed_loop.sampled import ends, is_at_rest, sampled_metrics

Array = NDArray[np.float64]

DAMPING = 0.4
FREQUENCY = 3.0


def textbook(samples: int, horizon: float = 12.0) -> StepMetrics:
    """Characteristics of 1 - exp(-z w t) (cos(w_d t) + z w / w_d sin(w_d t)), sampled."""
    time = np.linspace(0.0, horizon, samples)
    swing = FREQUENCY * np.sqrt(1 - DAMPING**2)
    decay = np.exp(-DAMPING * FREQUENCY * time)
    ratio = DAMPING * FREQUENCY / swing
    speed = 1 - decay * (np.cos(swing * time) + ratio * np.sin(swing * time))
    slope = decay * FREQUENCY**2 / swing * np.sin(swing * time)
    return sampled_metrics(time, speed[:, None], slope[:, None])


def test_underdamped_peak_is_the_textbook_one() -> None:
    """Overshoot exp(-pi z / sqrt(1 - z^2)) at pi / (w sqrt(1 - z^2)); 500 samples."""
    events = textbook(500)

    root = np.sqrt(1 - DAMPING**2)
    assert events.overshoot[0] == pytest.approx(100 * np.exp(-np.pi * DAMPING / root), rel=1e-5)
    assert events.peak_time[0] == pytest.approx(np.pi / (FREQUENCY * root), rel=1e-6)
    assert events.peak[0] == pytest.approx(1 + events.overshoot[0] / 100, rel=1e-6)


def test_crossings_converge_with_the_fourth_power_of_the_interval() -> None:
    """Theory of cubic Hermite interpolation: twice the samples divide the error by 16."""
    counts = np.array([101, 201, 401, 801])
    exact = textbook(100_001, 20.0).rise_time[0]

    errors = [abs(textbook(count, 20.0).rise_time[0] - exact) for count in counts]

    order = -np.polyfit(np.log(counts - 1), np.log(errors), 1)[0]
    assert order > 3.3


def test_settling_is_the_last_time_outside_the_band() -> None:
    """Reference: search on a grid of a million instants, from the end."""
    time = np.linspace(0.0, 12.0, 1_000_001)
    swing = FREQUENCY * np.sqrt(1 - DAMPING**2)
    ratio = DAMPING * FREQUENCY / swing
    error = np.exp(-DAMPING * FREQUENCY * time) * (
        np.cos(swing * time) + ratio * np.sin(swing * time)
    )

    expected = time[np.flatnonzero(np.abs(error) > 0.02)[-1]]

    assert textbook(500).settling_time[0] == pytest.approx(expected, abs=2e-5)


def test_a_response_without_overshoot_has_no_peak_time() -> None:
    """1 - exp(-t) rises from 10 to 90 % in ln 9 and settles after ln 50."""
    time = np.linspace(0.0, 25.0, 2001)
    speed = 1 - np.exp(-time)

    events = sampled_metrics(time, speed[:, None], np.exp(-time)[:, None])

    assert events.overshoot[0] == 0.0
    assert np.isnan(events.peak_time[0])
    assert events.rise_time[0] == pytest.approx(np.log(9.0), rel=1e-6)
    assert events.settling_time[0] == pytest.approx(np.log(50.0), rel=1e-6)


def test_an_undamped_response_does_not_settle() -> None:
    """An oscillation of 10 % around the final value leaves the 2 % band again and again."""
    time = np.linspace(0.0, 40.0, 4001)
    speed = (1 - np.exp(-time)) + 0.1 * np.sin(5 * np.pi * time)
    slope = np.exp(-time) + 0.5 * np.pi * np.cos(5 * np.pi * time)

    events = sampled_metrics(time, speed[:, None], slope[:, None])

    assert np.isnan(events.settling_time[0])
    assert events.steady_state[0] == pytest.approx(1.0, abs=2e-3)
    assert is_at_rest(speed[:, None])[0]


def test_a_response_that_is_constant_or_not_finite_is_undefined() -> None:
    """A motor that sticks, and a response that diverges to infinity."""
    time = np.linspace(0.0, 1.0, 101)
    speed = np.column_stack([np.full(101, 1e-4), np.full(101, np.inf)])

    events = sampled_metrics(time, speed, np.zeros((101, 2)))

    assert np.isnan(events.rise_time).all()
    assert np.isnan(events.settling_time).all()
    assert np.isnan(events.steady_state[1])


@pytest.mark.parametrize("phase", [0.0, 0.7, 1.4, 2.1, 2.8])
def test_oscillation_of_any_phase_leaves_the_final_value(phase: float) -> None:
    """Sidelobes of a Hann window: a thirtieth of 2 % remains of 2.4 periods in the last tenth."""
    time = np.linspace(0.0, 1.0, 2001)
    speed = 1.0 + 0.02 * np.sin(2 * np.pi * 24.0 * time + phase)[:, None]

    assert ends(speed)[0][0] == pytest.approx(1.0, abs=0.02 / 30)
    assert is_at_rest(speed)[0]
