"""Models are compared on the samples that all of them predict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.effect import AbstractEffect
from identification.effects.sensor import ChannelDelay, SpeedFilter
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits, continued
from identification.model.excitation import Record, records_of
from identification.selection.common_samples import chance_of_fading, common_edges
from identification.selection.evidence import EvaluatedModel, scores_of
from identification.selection.policy import DEFAULT
from identification.selection.refit import refitted_with
from identification.selection.start import Start
from identification.selection.validation import ValidationErrors
from tests.motors import campaign, motor_named

DEPTH, INTERVAL = 8, 1e-3
DELAY = ChannelDelay("speed", DEPTH, INTERVAL)
FILTER = SpeedFilter(0.1 * INTERVAL, 300 * INTERVAL)


@pytest.fixture(scope="module")
def nominal() -> Fit:
    """Fit of the nominal model to three runs of a servo without effects."""
    return fit_declared(records_of(campaign(motor_named("servo 100 W"), seed=1)), "zoh")


def with_lag(fit: Fit, term: AbstractEffect, lag: float) -> Fit:
    """The fit with a lag of the speed added, at this time [s]."""
    return refitted_with(fit, term, [Start(np.array([lag]))], TerminationLimits(0))


def with_noisy_start(fit: Fit) -> Fit:
    """The model at the same parameters, in runs with more noise of the speed in the first samples.

    That is the noise of the samples that the delay depends on: any other is as probable.
    """
    noise = np.random.default_rng(3).normal(0.0, 3.0, (len(fit.states), DEPTH))
    noise *= float(fit.weighting.deviation[1])

    def noisy(record: Record, own: np.ndarray) -> Record:
        measured = record.measured.copy()
        measured[:DEPTH, 1] += own
        return replace(record, measured=measured)

    records = tuple(map(noisy, fit.simulator.records, noise))
    simulator = replace(fit.simulator, records=records)
    weighting = replace(fit.weighting, records=records)
    return continued(replace(fit, simulator=simulator, weighting=weighting), TerminationLimits(0))


def test_noise_of_samples_that_a_delay_omits_does_not_count_against_others(nominal: Fit) -> None:
    """The difference of the criterion of both models is that without the noise."""
    fits = [nominal, with_lag(nominal, DELAY, 0.01 * INTERVAL)]

    quiet = scores_of([EvaluatedModel(fit, 1.0) for fit in fits])
    noisy = scores_of([EvaluatedModel(with_noisy_start(fit), 1.0) for fit in fits])

    assert with_noisy_start(nominal).cost > nominal.cost + 10.0
    assert noisy[1] - noisy[0] == pytest.approx(quiet[1] - quiet[0], abs=1e-3)


def test_an_effect_gains_on_the_samples_that_both_models_predict(nominal: Fit) -> None:
    """A delay of a hundredth of an interval gains nothing, also if the first samples are noisy."""
    delayed = with_lag(nominal, DELAY, 0.01 * INTERVAL)

    after, before = (EvaluatedModel(with_noisy_start(fit), 1.0) for fit in (delayed, nominal))

    assert after.criteria(before, tried=1).gain == pytest.approx(0.0, abs=1.0)


def test_a_prediction_is_compared_on_the_samples_that_both_models_predict(nominal: Fit) -> None:
    """The first samples of one model have a large error, which the delay does not predict."""
    (record, *_) = nominal.simulator.records
    rng = np.random.default_rng(4)
    residual = rng.standard_normal((record.rows, 2))
    residual[:DEPTH, 1] = 30.0
    delayed = with_lag(nominal, DELAY, 0.01 * INTERVAL)
    inner = record.within(delayed.simulator.model.edges)

    own = ValidationErrors.of([(record, residual)], 1.0)
    other = ValidationErrors.of([(inner, residual)], 1.0)

    assert own.square[1] > 2.0 * other.square[1]
    models = EvaluatedModel(nominal, 1.0, own), EvaluatedModel(delayed, 1.0, other)
    assert not models[0].predicts_worse(models[1], DEFAULT)


@pytest.mark.parametrize(("lag", "share"), [(1.0, 0.0), (200.0, 1.0)])
def test_an_initial_value_gains_by_chance_where_it_is_visible(
    nominal: Fit, lag: float, share: float
) -> None:
    """The influence of a filter's initial value fades with its time constant, in intervals."""
    filtered = with_lag(nominal, FILTER, lag * INTERVAL)
    edges = common_edges([filtered, with_lag(nominal, DELAY, INTERVAL)])

    whole = 0.5 * len(filtered.states)
    assert chance_of_fading(filtered) == whole
    assert edges == ((0, 0), (DEPTH, 0))
    assert chance_of_fading(filtered, edges) == pytest.approx(share * whole, abs=0.1 * whole)
