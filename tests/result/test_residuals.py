"""Residual checks of the report for runs with pauses and unused samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.result.report_data import RunTraces
from identification.result.residuals import (
    channel_whiteness,
    coloured_channels,
    residual_checks,
)
from tests.reports import make_report


@pytest.fixture
def run() -> RunTraces:
    """Run whose simulation is exact."""
    return make_report(rows=3000).runs[0]


def test_white_residuals_are_not_called_coloured() -> None:
    """The simulations are exact, so the residual is the added white noise."""
    assert coloured_channels(residual_checks(make_report(rows=3000).runs)) == []


def test_a_slow_error_of_the_speed_is_called_coloured(run: RunTraces) -> None:
    """A drift as large as the noise over a thousand samples is autocorrelated."""
    drift = 0.35 * np.sin(2 * np.pi * np.arange(run.time.size) / 1000)

    checks = residual_checks([replace(run, after_speed=run.after_speed + drift)])

    assert coloured_channels(checks) == ["speed"]


def test_a_nominal_model_is_checked_only_if_it_differs() -> None:
    """`before` exists for the motor with an effect only."""
    clean, told = (make_report(rows=500, with_effect=effect).runs for effect in (False, True))

    assert [check.plots[0][2] for check in residual_checks(clean)] == [None, None]
    assert all(check.plots[0][2] is not None for check in residual_checks(told))


def test_samples_that_were_not_used_do_not_count(run: RunTraces) -> None:
    """Omitting a third of the samples leaves the others white."""
    holes = run.measured_speed.copy()
    holes[1000:2000] = np.nan

    test = channel_whiteness(replace(run, measured_speed=holes), "speed")

    assert test is not None
    assert test > 1e-3


def test_both_sides_of_a_pause_are_separate_runs(run: RunTraces) -> None:
    """Pulses before and after a pause do not contribute to a common lag."""
    flat = np.zeros(run.time.size)
    flat[1499] = flat[1500] = 10.0
    late = run.time.copy()
    late[1500:] += 9.0
    pulsed = replace(run, measured_speed=flat, after_speed=np.zeros_like(flat))

    glued = residual_checks([pulsed])[1].plots[0][1].values[0]
    apart = residual_checks([replace(pulsed, time=late)])[1].plots[0][1].values[0]

    assert glued == pytest.approx(0.5)
    assert apart == pytest.approx(0.0, abs=1e-12)


def test_a_run_of_a_few_samples_has_no_test(run: RunTraces) -> None:
    """Five samples are too few for an autocorrelation test."""
    short = {
        name: getattr(run, name)[:5]
        for name in (
            "time", "voltage", "measured_current", "measured_speed", "after_current", "after_speed",
        )
    }  # fmt: skip

    assert channel_whiteness(replace(run, **short), "speed") is None
    assert residual_checks([]) == []
