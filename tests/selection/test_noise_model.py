"""Selection in coloured and heavy-tailed noise: the noise model of the residual decides."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import pytest

from bench import EffectRequest, Noise, make_campaign
from identification.fit.campaign import Campaign
from identification.fit.declared import fit_declared
from identification.fit.noise import with_noise_model
from identification.selection.evidence import EvaluatedModel
from identification.selection.noise_model import under_noise_model, with_ordinary_noise
from identification.selection.outcome import Outcome
from identification.selection.policy import DEFAULT
from identification.selection.search import search
from identification.selection.simulation_error import unweighted_deviation
from identification.selection.steps import State, admissible
from identification.selection.trials import Trials
from tests.effects.hidden import all_but, records_of_bench
from tests.selection.extended import extended

SEED, ROWS, RUNS = 2, 1500, 2
WHITE, COLOURED, SPIKY = Noise(kind="white"), Noise(kind="coloured"), Noise(kind="spiky")


def campaign_with(noise: Noise, effects: Sequence[EffectRequest] = ()) -> Campaign:
    """Runs of a servo motor with effects and one kind of noise, and one for validation."""
    measured = make_campaign(
        "servo_150w", effects, seed=SEED, rows=ROWS, training=RUNS, validation=1, noise=noise
    )
    return records_of_bench(measured)


def outcome_of(campaign: Campaign, withheld: Collection[str] = ()) -> Outcome:
    """Outcome of the search."""
    return search(fit_declared(campaign.training, "zoh"), campaign, withheld=withheld)


def test_a_filter_is_told_from_a_delay_in_coloured_noise() -> None:
    """Known: a time constant of one interval.

    Slow noise changes little between two samples, so that the edge of a filter stands out in it.
    """
    withheld = all_but("speed_filter", "channel_delay", "current_filter", "shaft_compliance")
    campaign = campaign_with(COLOURED, [EffectRequest("speed_filter", 0.1)])

    outcome = outcome_of(campaign, withheld)

    (effect,) = outcome.effects
    assert effect.name == "speed_filter"
    assert effect.probability > 0.99


@pytest.mark.parametrize("noise", [COLOURED, SPIKY])
def test_noise_adds_no_effect_and_the_result_has_ordinary_noise(noise: Noise) -> None:
    """The noise model of the result is that of independent normal errors, as without an effect."""
    outcome = outcome_of(campaign_with(noise))

    assert outcome.effects == ()
    assert outcome.fit.weighting.order == 0
    assert outcome.fit.weighting.robust is None


def test_the_search_goes_on_under_the_noise_model_of_the_residual() -> None:
    """White noise needs none; that of coloured noise has a filter, and so has the nominal model."""
    found = {}
    for noise in (WHITE, COLOURED):
        campaign = campaign_with(noise)
        trials = Trials(campaign)
        nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))
        found[noise.kind] = under_noise_model(State(trials, nominal, nominal))

    assert found["white"] is None
    state = found["coloured"]
    assert state is not None
    assert state.nominal.fit.weighting.order > 0
    assert state.current.fraction > 0.9
    errors = state.current.unseen
    assert errors is not None
    innovation = state.current.fit.weighting.deviation**2
    np.testing.assert_allclose(errors.square, innovation, rtol=0.3)


def test_a_slow_effect_in_coloured_noise_is_kept_for_its_simulation_error() -> None:
    """A drag of 8 % of the rated torque causes a sixth of the error, but no change of edges.

    Its gain under the noise model is that of the whitened error, and is significant.
    """
    campaign = campaign_with(COLOURED, [EffectRequest("quadratic_drag", 0.08)])
    trials = Trials(campaign)
    nominal = trials.evaluate(fit_declared(campaign.training, "zoh"))
    dragged = extended(trials, nominal, "quadratic_drag")
    state = under_noise_model(State(trials, nominal, dragged))
    assert state is not None

    criteria = state.trials.criteria(state.current, state.nominal)

    assert criteria.training == pytest.approx(0.015, abs=0.002)
    assert criteria.training < DEFAULT.least_fall
    assert criteria.simulation == pytest.approx(0.17, abs=0.01)
    assert criteria.gain > criteria.needed
    assert criteria.is_kept
    assert not criteria.passed
    assert trials.criteria(dragged, nominal).simulation == -np.inf
    # In place of another effect, such as a current offset, the same drag is judged alike.
    assert admissible(state, [state.current], state.nominal) == [state.current]


def test_an_ordinary_fit_from_a_whitened_one_is_the_ordinary_fit() -> None:
    """Both are the optimum of the same likelihood, reached from two sides."""
    ordinary = fit_declared(campaign_with(COLOURED).training, "zoh")

    again = with_ordinary_noise(with_noise_model(ordinary))

    assert again.cost == pytest.approx(ordinary.cost, abs=1e-2)
    np.testing.assert_allclose(again.position, ordinary.position, atol=0.05)


def test_the_errors_of_training_and_validation_are_compared_without_student_weights() -> None:
    """The fall in training is that of the RMS residual, spikes included, as in validation."""
    plain = fit_declared(campaign_with(SPIKY).training, "zoh")
    fit = with_noise_model(plain)
    residuals = np.concatenate(fit.residuals())

    assert fit.weighting.robust is not None
    assert fit.weighting.order == 0
    np.testing.assert_allclose(
        unweighted_deviation(fit), np.sqrt(np.mean(residuals**2, axis=0)), rtol=1e-6
    )
    assert np.all(unweighted_deviation(fit) > fit.weighting.deviation)
    assert unweighted_deviation(plain) is plain.weighting.deviation
    # Nearly the same parameters and residuals, in both cases without the weights.
    assert abs(EvaluatedModel(fit, 1.0).criteria(EvaluatedModel(plain, 1.0), 1).training) < 0.01
