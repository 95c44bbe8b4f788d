"""Thermometer that lags the winding, and winding that lags the thermometer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.effects.lag import WindingLag
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.fit.evaluate import simulate_unseen
from identification.ingest.run import Run
from identification.selection.candidates import scales_of
from identification.selection.search import search
from tests.effects.hidden import all_but
from tests.motors import drive, motor_named, simulated

Array = NDArray[np.float64]

WITHHELD = all_but(
    *("self_heating", "winding_lag", "magnet_lag", "resistance_curvature", "demagnetization"),
    *("viscous_temperature", "coulomb_friction"),
)
MOTOR = replace(motor_named("servo 100 W"), interval=4e-3)
ROWS = 2000
LAG = 1.5
"""Time constant of the lag [s], in runs of 8 s."""


def _lagging(temperature: Array, lag: float = LAG) -> Array:
    """Response of a first-order lag to a temperature, from equilibrium [degC]."""
    kept = np.exp(-MOTOR.interval / lag)
    return np.asarray(lfilter([1 - kept], [1.0, -kept], temperature, zi=[kept * temperature[0]])[0])


def _campaign(direction: str) -> Campaign:
    """Runs whose heating increases on the way; the log has noise and a resolution of 0.1 K.

    Args:
        direction: Which temperature lags which.
    """
    rng = np.random.default_rng(4)
    time = MOTOR.interval * np.arange(ROWS, dtype=np.float64)
    runs = []
    for k in range(4):
        voltage = drive(MOTOR, "steps", ROWS, rng)
        rise = 30.0 * (1 - np.exp(-time / 3.0)) + 15.0 * (1 - np.exp(-np.fmax(time - 5.0, 0) / 2.0))
        driven = 25.0 + 15.0 * k + rise
        lagging = _lagging(driven)
        is_ahead = direction.startswith("the log lags")
        winding, shown = (driven, lagging) if is_ahead else (lagging, driven)
        magnet = winding if direction.endswith("magnet") else shown
        exact = simulated(
            MOTOR.vector, MOTOR.interval, voltage, winding, np.zeros(2), magnet=magnet
        )
        noisy = exact + 0.005 * exact.std(axis=0) * rng.standard_normal(exact.shape)
        logged = shown + 0.1 * rng.standard_normal(ROWS)
        current, speed = noisy.T
        runs.append(
            Run(f"{k}.csv", f"{k:064d}", time, voltage, current, speed, np.round(logged, 1))
        )
    return campaign_of(runs[:3], runs[3:])


@pytest.mark.parametrize(
    ("direction", "variant"),
    [
        ("the winding lags the log", "winding lags the logged temperature"),
        ("the log lags the winding", "logged temperature lags the winding"),
        ("the log lags winding and magnet", "logged temperature lags winding and magnet"),
    ],
)
def test_a_lag_is_found_in_its_direction(direction: str, variant: str) -> None:
    """Runs in closed form at the true temperatures; the lag is 1.5 s."""
    campaign = _campaign(direction)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)

    assert [found.name for found in outcome.effects] == ["winding_lag"]
    assert outcome.fit.values[-1] == pytest.approx(LAG, rel=0.1)
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, WindingLag)
    assert (term.direction, term.variant) == (direction, variant)
    np.testing.assert_allclose(outcome.fit.values[:2], MOTOR.vector[:2], rtol=0.03)


def _in_steps(lag: float, step: float, noise: float, drifts: Sequence[float]) -> Campaign:
    """Runs that warm or cool while a lagging thermometer logs steps.

    Args:
        lag: Time constant of the thermometer [s].
        step: Step of its log [K].
        noise: Standard deviation of its noise before rounding [K].
        drifts: Temperature rise of each run [K].
    """
    rng = np.random.default_rng(6)
    time = MOTOR.interval * np.arange(ROWS, dtype=np.float64)
    runs = []
    for k, drift in enumerate(drifts):
        voltage = drive(MOTOR, "steps", ROWS, rng)
        body = 30.0 + 20.0 * k + drift * -np.expm1(-2.0 * time / time[-1])
        exact = simulated(MOTOR.vector, MOTOR.interval, voltage, body, np.zeros(2), magnet=body)
        noisy = exact + 0.005 * exact.std(axis=0) * rng.standard_normal(exact.shape)
        seen = _lagging(body, lag) + noise * rng.standard_normal(ROWS)
        shown = step * np.round(seen / step)
        current, speed = noisy.T
        runs.append(Run(f"{k}.csv", f"{k:064d}", time, voltage, current, speed, shown))
    return campaign_of(runs[:3], runs[3:])


@pytest.mark.parametrize(
    ("lag", "drifts"), [(12.0, (-2.0, 9.0, -8.0, 5.0)), (8.0, (8.0, 2.0, -9.0, -6.0))]
)
def test_nothing_stands_in_for_what_a_slow_thermometer_in_steps_hides(
    lag: float, drifts: tuple[float, ...]
) -> None:
    """Nominal motor in closed form, with a thermometer that lags by more than a run, in 1 K steps.

    A log that moves by two or three steps determines no derivative, so no effect may absorb it, and
    the covariance of the fit includes what it leaves open.
    """
    campaign = _in_steps(lag, 1.0, 0.0, drifts)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign)

    assert [found.name for found in outcome.effects] == ["winding_lag"]
    np.testing.assert_allclose(outcome.fit.values[:4:2], MOTOR.vector[:4:2], rtol=0.02)
    missed = (outcome.fit.values[:7] - MOTOR.vector) / outcome.fit.deviations[:7]
    assert np.abs(missed).max() < 3.0
    for unseen in simulate_unseen(outcome.fit, campaign.validation):
        noise = 0.005 * unseen.record.measured.std(axis=0)
        assert np.all(unseen.residual.std(axis=0) < 1.1 * noise)


@pytest.mark.parametrize(
    ("lag", "noise", "drifts"),
    [(30.0, 0.02, (12.0, 9.0, 12.0, 10.0)), (100.0, 0.05, (24.0, 18.0, 20.0, 24.0))],
)
def test_a_thermometer_may_lag_by_many_runs(
    lag: float, noise: float, drifts: tuple[float, ...]
) -> None:
    """Runs of 8 s in an oven, with a log in steps of 0.1 K that noise dithers in part or wholly.

    The log moves by 1 to 2 K, the winding by 10 to 24 K: nothing else may stand in for it.
    """
    campaign = _in_steps(lag, 0.1, noise, drifts)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)

    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, WindingLag)
    assert term.direction == "the log lags winding and magnet"
    assert outcome.fit.values[7] == pytest.approx(lag, rel=0.1)
    np.testing.assert_allclose(outcome.fit.values[:4], MOTOR.vector[:4], rtol=0.01)
    missed = (outcome.fit.values[:7] - MOTOR.vector) / outcome.fit.deviations[:7]
    assert np.abs(missed).max() < 3.5


@pytest.mark.parametrize(
    ("lag", "drifts"), [(3.0, (40.0, -35.0, 30.0, 30.0)), (6.0, (25.0, -30.0, 20.0, 10.0))]
)
def test_a_log_of_many_steps_limits_the_error_of_its_smoothing(
    lag: float, drifts: tuple[float, ...]
) -> None:
    """The smoothed log errs most at the ends of a run, in the same way as other coefficients."""
    campaign = _in_steps(lag, 1.0, 0.0, drifts)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=WITHHELD)

    assert [found.name for found in outcome.effects] == ["winding_lag"]
    assert outcome.fit.values[-1] == pytest.approx(lag, rel=0.02)
    np.testing.assert_allclose(outcome.fit.values[:4], MOTOR.vector[:4], rtol=0.005)
    missed = (outcome.fit.values[:7] - MOTOR.vector) / outcome.fit.deviations[:7]
    assert np.abs(missed).max() < 3.0


def test_the_prior_of_the_error_of_a_log_is_its_mean_square_over_the_longest_run() -> None:
    """Waves that cancel cost no more than the error that is left of them."""
    term = WindingLag(0.1, 10.0, "the log lags the winding", 8.0, 1.0, 0.1)
    shapes, root = term.log_error(np.linspace(0.0, 8.0, 4001)), term.own_root
    assert shapes is not None
    assert root is not None
    amplitudes = np.random.default_rng(2).normal(size=(len(term.states), 50))

    mean_squares = np.mean((shapes @ amplitudes) ** 2, axis=0)

    np.testing.assert_allclose(np.sum((root @ amplitudes) ** 2, axis=0), mean_squares, rtol=2e-3)


@pytest.mark.parametrize(
    ("step", "noise", "coarse"), [(1.0, 0.0, 1.0), (0.1, 0.0, 0.1), (0.1, 0.1, 0.0)]
)
def test_a_log_leaves_open_what_no_noise_dithers(step: float, noise: float, coarse: float) -> None:
    """The mean resolves less than a step only if the noise is as large as the step."""
    records = _in_steps(3.0, step, noise, (8.0, -8.0, 4.0, -4.0)).training

    assert {round(record.resolution, 6) for record in records} == {coarse}


@pytest.mark.parametrize("share", [0.2, 0.25])
def test_noise_below_a_third_of_a_step_dithers_a_log_in_part(share: float) -> None:
    """The step that is left has the error of the averages of the log; no level of it is exact."""
    campaign = _in_steps(3.0, 0.5, 0.5 * share, (30.0, -30.0, 40.0, -40.0))

    theory = 0.5 * np.sqrt(12.0) / (np.sqrt(2.0) * np.pi) * np.exp(-2.0 * (np.pi * share) ** 2)
    for record in campaign.training:
        assert record.resolution == pytest.approx(theory, rel=0.25)
        assert record.coarse_log is None


@pytest.mark.parametrize("is_part", [False, True])
def test_the_error_of_a_log_in_steps_is_a_candidate_even_if_the_log_hardly_moves(
    is_part: bool,
) -> None:
    """A part of a run may show no step, although the temperature changes within the run."""
    campaign = _in_steps(8.0, 1.0, 0.0, (9.0, -9.0, 4.0, -4.0))
    if is_part:
        short = tuple(record.segment(900, 100) for record in campaign.training)
        campaign = replace(campaign, training=short)
    fit = fit_declared(campaign.training, "zoh")

    variants = [c.final.variant for c in WindingLag.candidates(scales_of(fit))]

    assert sum(variant.endswith("error of the log") for variant in variants) == 2
    assert (len(variants) > 2) is not is_part


def test_the_searched_part_of_a_run_may_show_little_of_a_lag_of_the_log() -> None:
    """The log moves by 0.05 to 0.2 K while the winding cools by 2 K."""
    campaign = _in_steps(60.0, 0.1, 0.1, (-5.0, -5.0, -5.0, -5.0))
    parts = tuple(record.segment(700, 800) for record in campaign.training)
    fit = fit_declared(parts, "zoh")

    movement = max(float(np.ptp(record.column("temperature"))) for record in parts)
    variants = [c.final.variant for c in WindingLag.candidates(scales_of(fit))]

    assert 0.05 < movement < 0.2
    assert "logged temperature lags winding and magnet" in variants
