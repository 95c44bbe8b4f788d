"""Filters of the sensors take their lags back from the inductance, also from a local optimum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from bench import EffectRequest, make_campaign
from identification.effects.electrical import BrushDrop
from identification.effects.sensor import ChannelDelay, CurrentFilter, SpeedFilter
from identification.fit.campaign import Campaign, campaign_of
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits
from identification.ingest import Run
from identification.model.excitation import records_of
from identification.model.term import AbstractTerm
from identification.selection import refit
from identification.selection.candidates import scales_of
from identification.selection.lagged import with_filters
from identification.selection.start import Start
from identification.selection.trials import Trials
from tests.effects.hidden import records_of_bench

R, K, L, J, B, FILTER, STEP, ROWS = 4.2, 0.018, 3e-3, 2.5e-6, 8e-6, 10e-3, 1e-3, 1500
SPEED_FILTER = 5e-3


def filtered_run(
    speed_filter: float = 0.0, seed: int = 5, drop: float = 0.0, noise: float = 1.0
) -> Run:
    """Steps of a small motor in both directions, the current through a filter.

    A bridge takes the voltage `drop` [V] against the current; the speed has the given noise
    [rad/s].
    """
    rng = np.random.default_rng(seed)
    voltage = np.repeat(rng.uniform(-12.0, 12.0, ROWS // 150), 150)
    i, w, shown, turning = 0.0, 0.0, 0.0, 0.0
    current, speed = np.zeros(ROWS), np.zeros(ROWS)
    for k in range(ROWS):
        current[k], speed[k] = shown, turning if speed_filter else w
        for _ in range(20):
            i += STEP / 20 / L * (voltage[k] - R * i - K * w - drop * np.tanh(i / 0.05))
            w += STEP / 20 / J * (K * i - B * w)
            shown += (i - shown) * STEP / 20 / FILTER
            turning += (w - turning) * STEP / 20 / (speed_filter or FILTER)
    current += rng.normal(0.0, 0.01, ROWS)
    speed += rng.normal(0.0, noise, ROWS)
    time = STEP * np.arange(ROWS, dtype=np.float64)
    return Run(f"{seed}.csv", str(seed), time, voltage, current, speed)


def test_a_fit_that_ends_with_the_whole_lag_in_the_inductance_is_repeated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first fit ends at a small filter beside the large L, as at a local optimum."""
    fit = fit_declared(records_of([filtered_run()]), "zoh")
    candidate = CurrentFilter.candidates(scales_of(fit))[0]
    small = Start(candidate.starts[:, 0])
    fitted, starts_of_fits = refit.refitted_with, []

    def ended_early(
        fit: Fit, term: AbstractTerm, starts: Sequence[Start], limits: TerminationLimits
    ) -> Fit:
        starts_of_fits.append(len(starts))
        if len(starts_of_fits) == 1:
            return fitted(fit, term, [small], TerminationLimits(0))
        return fitted(fit, term, starts, limits)

    monkeypatch.setattr(refit, "refitted_with", ended_early)
    found = refit.fitted_candidate(fit, candidate, [small]).by_name

    assert fit.by_name["L"] > 5.0 * L
    assert starts_of_fits[:2] == [1 + len(candidate.traded), len(candidate.traded)]
    assert found["current_filter.time_constant"] == pytest.approx(FILTER, rel=0.2)
    assert found["L"] < 3.0 * L


def test_a_filter_of_the_current_is_told_from_the_motor_by_a_speed_with_much_noise() -> None:
    """Of the three lags of the logged current, only the speed shows which is that of the filter."""
    fit = fit_declared(records_of([filtered_run(noise=100.0)]), "zoh")
    candidate = CurrentFilter.candidates(scales_of(fit))[0]
    starts = [Start(own) for own in candidate.starts.T]
    found = refit.fitted_candidate(fit, candidate, starts).by_name

    assert found["Ra25"] == pytest.approx(R, rel=0.05)
    assert found["L"] == pytest.approx(L, rel=0.3)
    assert found["current_filter.time_constant"] == pytest.approx(FILTER, rel=0.05)


def test_filters_of_both_sensors_leave_the_inductance_of_the_motor() -> None:
    """The lag of the inductance in the speed is returned only if both filters take their parts."""
    fit = fit_declared(records_of([filtered_run(SPEED_FILTER)]), "zoh")
    absorbed = fit.by_name["L"]
    for law in (CurrentFilter, SpeedFilter):
        candidate = law.candidates(scales_of(fit))[0]
        fit = refit.fitted_candidate(fit, candidate, [Start(candidate.starts[:, 0])])
    found = fit.by_name

    assert absorbed > 5.0 * L
    assert found["L"] == pytest.approx(L, rel=0.2)
    assert found["current_filter.time_constant"] == pytest.approx(FILTER, rel=0.05)
    assert found["speed_filter.time_constant"] == pytest.approx(SPEED_FILTER, rel=0.05)


def test_a_delay_of_the_speed_is_told_from_the_inductance_beside_a_filter_of_the_current() -> None:
    """One large inductance lags both channels by as much; only its whole change fits better."""
    lags = [EffectRequest("channel_delay", 0.1, "speed"), EffectRequest("current_filter", 0.12)]
    measured = make_campaign(28_010_044, lags, seed=28_000_044, rows=600, validation=1)
    fit = fit_declared(records_of_bench(measured).training, "zoh")
    for law, variant in ((CurrentFilter, ""), (ChannelDelay, "speed")):
        own = law.candidates(scales_of(fit))
        (candidate,) = (one for one in own if one.term.variant == variant)
        fit = refit.fitted_candidate(fit, candidate, [Start(candidate.starts[:, 0])])
    found, truth = fit.by_name, measured.truth

    delay, lag = (effect["values"]["time"] for effect in truth["effects"])
    assert found["L"] == pytest.approx(truth["parameters"]["L"], rel=0.02)
    assert found["channel_delay.delay"] == pytest.approx(delay, rel=0.02)
    assert found["current_filter.time_constant"] == pytest.approx(lag, rel=0.02)


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    """Two runs of a bench with filters of both sensors, one for validation."""
    runs = [filtered_run(SPEED_FILTER, seed) for seed in (5, 6)]
    return campaign_of(runs[:1], runs[1:])


def test_the_selection_starts_with_both_filters_if_no_motor_has_the_inductance(
    campaign: Campaign,
) -> None:
    """A filter of the current alone gains little, and an elastic shaft more than it."""
    trials = Trials(campaign)
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))

    found = with_filters(trials, nominal).fit

    assert nominal.fit.by_name["L"] > 5.0 * L
    assert {term.name for term in found.simulator.model.terms} == {"current_filter", "speed_filter"}
    assert found.by_name["L"] == pytest.approx(L, rel=0.3)


def test_the_selection_starts_at_the_nominal_model_if_a_filter_is_withheld(
    campaign: Campaign,
) -> None:
    """The same runs start with both filters if none is."""
    trials = Trials(campaign, withheld=["speed_filter"])
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))

    assert with_filters(trials, nominal) is nominal


def test_both_filters_are_found_beside_the_brush_drop_that_hid_them() -> None:
    """The nominal model cannot take the filters; the model with the drop can."""
    runs = [filtered_run(SPEED_FILTER, seed, drop=1.8) for seed in (5, 6, 7)]
    campaign = campaign_of(runs[:2], runs[2:])
    trials = Trials(campaign)
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))
    (candidate,) = BrushDrop.candidates(scales_of(nominal.fit))
    starts = [Start(own) for own in candidate.starts.T]
    beside = trials.evaluate(refit.fitted_candidate(nominal.fit, candidate, starts))

    found = with_filters(trials, beside).fit

    assert with_filters(trials, nominal) is nominal
    assert beside.fit.by_name["L"] > 5.0 * L
    names = {term.name for term in found.simulator.model.terms}
    assert names == {"brush_drop", "current_filter", "speed_filter"}
    assert found.by_name["L"] == pytest.approx(L, rel=0.3)
