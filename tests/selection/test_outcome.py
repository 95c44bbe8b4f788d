"""Probability of effects in a final model that leaves more than noise."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from identification.fit.solve import Fit
from identification.selection.criteria import AcceptanceCriteria
from identification.selection.outcome import Alternative, Found, Outcome

CRITERIA = AcceptanceCriteria(640.0, 28.0, 1.9, 1.9, 2.0, 600.0, False, unknowns=3, tried=400)
OTHER = Alternative("brush_drop", 0.1, cast(Fit, None), 1.0)
HEATING = Found("self_heating", 0.9, CRITERIA, (OTHER,))
"""Self-heating that lowers both errors to e^-0.95, that is 39 %."""


def test_effects_of_a_model_at_the_noise_keep_their_probabilities() -> None:
    """The noise explains both errors; only the compared models matter."""
    assert HEATING.given(np.array([1.0, 0.9])) == HEATING


def test_heating_that_leaves_ten_times_the_noise_may_be_a_term_outside_the_catalogue() -> None:
    """It halves the discrepancy, as the best of 400 prototypes may do by chance."""
    found = HEATING.given(np.array([10.0, 2.0]))

    assert 0.1 < found.probability < 0.5
    assert found.others[0][0] == "unlisted"
    assert found.probability + sum(share for _, share in found.others) == pytest.approx(1.0)


def test_an_effect_that_explains_nearly_all_keeps_its_name_beside_a_small_discrepancy() -> None:
    """The error was 40 times the noise and is 1.5 times the noise."""
    criteria = replace(CRITERIA, validation=2 * np.log(40.0 / 1.5))

    found = replace(HEATING, criteria=criteria).given(np.array([1.5, 1.5]))

    assert found.probability > 0.999 * HEATING.probability


def test_a_name_is_the_less_probable_the_more_remains() -> None:
    """The error before is 20 times the noise."""
    shares = []
    for after in (1.2, 2.0, 5.0, 10.0, 15.0, 19.0):
        criteria = replace(CRITERIA, validation=2 * np.log(20.0 / after))
        one = replace(HEATING, criteria=criteria)
        shares.append(one.given(np.array([after, after])).probability)

    assert shares == sorted(shares, reverse=True)
    assert shares[-1] < 0.01


@pytest.mark.parametrize(("share", "is_doubtful"), [(0.01, True), (0.05, True), (1.0, False)])
def test_a_small_effect_may_be_the_form_of_an_approximate_law(
    share: float, is_doubtful: bool
) -> None:
    """Friction of a gear explains 16 times the noise; the effect beside it a share of that."""
    most = 16.0**2 - 1.0
    falls = np.log(1.0 + most), np.log(1.0 + share * most)
    gear, effect = (
        replace(HEATING, criteria=replace(CRITERIA, validation=fall), alternatives=())
        for fall in falls
    )
    gear = replace(gear, name="unlisted", is_approximate=True)

    both = Outcome(cast(Fit, None), (gear, effect), ()).given(np.ones(2))
    exact = replace(gear, is_approximate=False)
    beside_exact = Outcome(cast(Fit, None), (exact, effect), ()).given(np.ones(2))

    assert (both.effects[1].probability < 0.5) is is_doubtful
    assert both.effects[0] == gear
    assert beside_exact.effects == (exact, effect)


def test_a_curve_claims_no_name_that_could_be_wrong() -> None:
    """`unlisted` is the alternative itself."""
    curve = replace(HEATING, name="unlisted")

    assert curve.given(np.array([10.0, 2.0])) == curve


def test_alternatives_of_a_subset_remain_if_the_budget_allows_none_on_all_samples() -> None:
    """An effect that was compared on all samples keeps what was found there."""
    alone = replace(HEATING, probability=1.0, alternatives=())
    outcome = Outcome(cast(Fit, None), (alone,), ())

    assert outcome.with_alternatives_of([HEATING]).effects == (HEATING,)
    assert outcome.with_alternatives_of([replace(HEATING, name="load_torque")]) == outcome
    compared = replace(outcome, effects=(HEATING,))
    assert compared.with_alternatives_of([alone]) == compared


def test_heating_that_no_winding_endures_is_left_to_a_term_outside_the_catalogue() -> None:
    """Other effects of the model keep their probabilities."""
    friction = replace(HEATING, name="coulomb_friction")
    doubted = Outcome(cast(Fit, None), (HEATING, friction), ()).doubting(["self_heating"])

    assert doubted.effects[0].probability == 0.0
    assert doubted.effects[0].others == [("unlisted", 1.0)]
    assert doubted.effects[1] == friction


def test_a_surrogate_makes_the_parameters_as_uncertain_as_its_removal_changes_them() -> None:
    """The share of the draws is the probability of a term outside the catalogue."""
    heating = replace(HEATING, removal={"Ra25": 0.2})
    doubted = Outcome(cast(Fit, None), (heating,), ()).given(np.array([10.0, 2.0]))

    (term,) = doubted.doubtful

    assert (term.name, term.steps) == ("self_heating", {"Ra25": 0.2})
    assert term.share == doubted.effects[0].outside > 0.5
    assert Outcome(cast(Fit, None), (heating,), ()).doubtful == ()


def test_an_effect_of_a_model_that_explains_nothing_is_doubtful_in_all_draws() -> None:
    """Its probability compares models of which none is true."""
    heating = replace(HEATING, removal={"Ra25": 0.2})
    outcome = Outcome(cast(Fit, None), (heating,), ()).without_probabilities()

    assert [term.share for term in outcome.doubtful] == [1.0]
    assert not outcome.effects[0].is_comparable
