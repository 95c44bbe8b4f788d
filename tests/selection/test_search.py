"""Search for effects: hidden effects are found; without any, none is reported."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench import EffectRequest, Noise, make_campaign
from benchmarks.calibration.plan import item_of
from identification.effects.effect import effects_of
from identification.effects.periodic import CoggingTorque
from identification.fit.declared import fit_declared
from identification.result.early_stop import early_stop_warnings
from identification.selection import trials
from identification.selection.outcome import Outcome
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.search import _is_overrun, search
from identification.selection.steps import State, forward
from identification.selection.trials import Trials
from identification.work import Budget, metered
from tests.effects.hidden import all_but, records_of_bench
from tests.selection.extended import frictions


def _outcome(motor: str, effects: list[str], seed: int) -> Outcome:
    measured = make_campaign(motor, effects, seed=seed, rows=600, training=3, validation=1)
    campaign = records_of_bench(measured)
    return search(fit_declared(campaign.training, "zoh"), campaign)


@pytest.mark.parametrize("motor", ["servo_150w", "ferrite_fan_30w"])
def test_a_motor_without_hidden_effects_comes_out_clean(motor: str) -> None:
    """The bench simulates the nominal motor."""
    outcome = _outcome(motor, [], seed=11)

    assert [effect.name for effect in outcome.effects] == []


@pytest.mark.parametrize("effect", ["coulomb_friction", "current_offset", "flux_saturation"])
def test_a_hidden_effect_is_named_and_its_error_goes_down_to_the_noise(effect: str) -> None:
    """The bench simulates exactly this effect, with physics code of its own."""
    outcome = _outcome("servo_150w", [effect], seed=12)

    assert [found.name for found in outcome.effects] == [effect]
    assert outcome.effects[0].criteria.passed
    assert outcome.effects[0].criteria.validation is not None
    assert outcome.effects[0].criteria.validation > 0.05


def test_a_friction_that_leaves_a_correlated_residual_is_compared_with_a_curve() -> None:
    """Coulomb friction is hidden and withheld; Stribeck friction removes 95 % of the error.

    In effective samples, few because the residual is correlated, no curve gains enough to be added
    to it.  A curve in its place leaves the noise.  A withheld kind is no candidate.
    """
    item = item_of(95)
    assert item.effect is not None
    measured = make_campaign(item.motor, [item.effect], item.number, item.options)
    campaign = records_of_bench(measured)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=item.withheld)

    found = {effect.name for effect in outcome.effects}
    b = measured.truth["parameters"]["b"]
    assert found == {"unlisted"}
    tried = {one.name for one in outcome.searched}
    assert "stribeck_friction" in tried
    assert "coulomb_friction" in item.withheld
    assert tried.isdisjoint(item.withheld)
    assert outcome.fit.by_name["b"] == pytest.approx(b, rel=0.1)


def test_a_search_in_which_no_score_is_finite_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dry friction is hidden; a simulation that diverges with every further term hides it too."""
    monkeypatch.setattr(trials, "screened", lambda *_: [])
    monkeypatch.setattr(trials, "missing_curves", lambda *_: [])

    outcome = _outcome("servo_150w", ["coulomb_friction"], seed=12)

    assert not outcome.effects
    assert not outcome.is_scored
    (warning,) = early_stop_warnings(outcome.fit, outcome, None, "normal", None)
    assert warning.code == "search_incomplete"
    assert "no further term could be scored" in warning.message


def test_a_search_that_stops_before_a_round_is_not_complete() -> None:
    """The share of the rounds is spent before the first; of the whole budget little is.

    Where no kind promises anything there is no round to come, and the search is complete.
    """
    policy = SelectionPolicy(catalogue_budget=1e-12)
    hidden = [EffectRequest("brush_drop")]
    complete = []
    for requests in (hidden, []):
        measured = make_campaign("servo_150w", requests, 11, rows=500, training=3, validation=1)
        campaign = records_of_bench(measured)
        declared = fit_declared(campaign.training, "zoh")
        outcome = search(declared, campaign, budget=Budget(1e13), policy=policy)
        assert not outcome.searched
        complete.append(outcome.complete)

    assert complete == [False, True]


def test_a_voltage_loss_with_the_square_of_the_current_is_no_heat_though_the_budget_ends() -> None:
    """Self-heating is refitted first and overruns the budget; that of the curves remains."""
    measured = make_campaign(
        "servo_150w", ["square_voltage_loss"], seed=12, rows=800, training=3, validation=1
    )
    campaign = records_of_bench(measured)

    with metered():
        outcome = search(fit_declared(campaign.training, "zoh"), campaign, budget=Budget(5e9))

    assert [found.name for found in outcome.effects] == ["unlisted"]
    assert not outcome.complete


def test_backlash_is_no_compliant_shaft_though_its_score_is_small() -> None:
    """Its predicted gain is a tenth of that of a shaft; a grid of starts finds 60 times as much."""
    request = EffectRequest("backlash", 0.112)
    measured = make_campaign(14_010_077, [request], 14_000_077, rows=600, training=3, validation=1)
    campaign = records_of_bench(measured)
    withheld = all_but("shaft_compliance", "inertia_change", "coulomb_friction", "channel_delay")

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=withheld)

    assert [found.name for found in outcome.effects] == ["unlisted"]
    terms = effects_of(outcome.fit.simulator.model.terms)
    assert [term.variant for term in terms] == ["backlash"]


def test_a_third_harmonic_of_cogging_is_part_of_the_cogging() -> None:
    """Orders 1, 2 and 3 of the slots are one kind; without the third nothing would fit.

    The angle is not logged, and the integral of the noisy speed alone, without order tracking,
    leaves 1.4 times the noise.
    """
    measured = make_campaign(
        "servo_150w",
        [EffectRequest("cogging_torque", law="three", size=0.15)],
        seed=17,
        rows=800,
        training=3,
        validation=1,
    )
    campaign = records_of_bench(measured)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign)

    assert [found.name for found in outcome.effects] == ["cogging_torque"]
    (term,) = outcome.fit.simulator.model.terms
    assert isinstance(term, CoggingTorque)
    assert (term.harmonics, term.angle) == (3, "integrated")
    noise = [measured.truth["noise"][name] for name in ("current_A", "speed_rad_s")]
    assert outcome.fit.weighting.deviation == pytest.approx(noise, rel=0.02)


def test_two_hidden_effects_are_both_named_and_nothing_else() -> None:
    """The bench simulates these two, in different balances."""
    outcome = _outcome("servo_150w", ["brush_drop", "coulomb_friction"], seed=13)

    assert sorted(effect.name for effect in outcome.effects) == ["brush_drop", "coulomb_friction"]


@pytest.mark.parametrize("seed", [40, 43])
def test_a_friction_that_stands_for_two_gives_way_to_both(seed: int) -> None:
    """A Stribeck law approximates dry and quadratic friction, with a small residual."""
    requests = [EffectRequest("coulomb_friction", 0.1), EffectRequest("stribeck_friction", 0.06)]
    measured = make_campaign("servo_150w", requests, seed=seed, rows=600, training=3, validation=1)
    campaign = records_of_bench(measured)
    withheld = all_but("coulomb_friction", "stribeck_friction", "quadratic_drag", "load_torque")

    outcome = search(fit_declared(campaign.training, "zoh"), campaign, withheld=withheld)

    named = sorted(effect.name for effect in outcome.effects)
    assert named == ["coulomb_friction", "stribeck_friction"]


def test_a_kind_is_named_under_another_law_than_the_catalogue_has() -> None:
    """Brush drop with unequal directions and a hyperbolic tangent as knee."""
    measured = make_campaign(
        "disc_servo_750w",
        [EffectRequest("brush_drop", law="uneven")],
        seed=14,
        rows=600,
        training=3,
        validation=1,
    )
    campaign = records_of_bench(measured)

    outcome = search(fit_declared(campaign.training, "zoh"), campaign)

    assert outcome.effects[0].name == "brush_drop"


def test_an_inductance_that_falls_far_has_a_predicted_gain() -> None:
    """L falls to a third at the usual current, for which the nominal model fits one constant."""
    request = EffectRequest("inductance_saturation", 0.174, law="exponential")
    measured = make_campaign(
        7_010_102, [request], seed=7_000_102, rows=1500, noise=Noise(kind="coloured")
    )
    campaign = records_of_bench(measured)
    trials = Trials(campaign)
    declared = trials.evaluate(fit_declared(campaign.training, "zoh"))

    gains = {score.candidate.term.name: score.gain for score in reversed(trials.scores(declared))}

    assert gains["inductance_saturation"] > trials.worth_a_refit(declared)
    assert gains["inductance_saturation"] > 0.5 * max(gains.values())


@pytest.mark.parametrize(("left", "is_overrun"), [(-40.0, True), (3.0, False), (60.0, False)])
def test_the_curves_have_a_quarter_of_the_budget_whatever_the_rounds_leave(
    left: float, is_overrun: bool
) -> None:
    """Of 100 operations, 25 are for curves; rounds that leave more keep it."""
    measured = make_campaign("servo_150w", [], 3, rows=300, training=1, validation=0)
    cache = Trials(records_of_bench(measured), Budget(left), DEFAULT.refit_budget * 100.0)

    assert _is_overrun(cache) is is_overrun
    assert cache.budget.left == pytest.approx(max(left, 25.0))


def test_a_candidate_is_fitted_after_those_with_far_larger_predicted_gains_have_failed() -> None:
    """Coulomb friction is hidden; a sag of Kt is predicted to gain ten thousand times as much."""
    trials, declared, best = frictions()
    truth, wrong = best["coulomb_friction"], best["flux_saturation"]
    small = 2.0 * trials.worth_a_refit(declared)
    trials._scores[frozenset()] = [replace(wrong, gain=1e4 * small), replace(truth, gain=small)]
    state = State(trials, declared, declared)

    assert forward(state)

    (term,) = state.current.fit.simulator.model.terms
    assert term.name == "coulomb_friction"
    assert {one.round for one in state.searched} == {1}
