"""What the runs left out have to say before an effect is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench import make_campaign
from identification.effects.load import LoadStep
from identification.effects.thermal import SelfHeating
from identification.fit.declared import fit_declared
from identification.fit.solve import Fit, TerminationLimits, solve
from identification.model.excitation import records_of
from identification.selection import trials
from identification.selection.evidence import (
    UNCOMPUTED,
    AcceptanceCriteria,
    EvaluatedModel,
    ValidationErrors,
    probabilities,
    scores_of,
)
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.refit import refitted_as, refitted_with, refitted_without
from identification.selection.start import Start
from identification.selection.trials import Trials
from tests.effects.hidden import records_of_bench
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")

REAL = AcceptanceCriteria(
    gain=900.0, needed=12.0, training=0.3, validation=0.25, possible=0.3, log_odds=80.0, local=False
)


def test_an_effect_that_all_runs_support_passes() -> None:
    """Far above chance, larger than two per cent, and foretold."""
    assert REAL.passed


def test_the_limits_of_the_criteria_are_those_of_the_policy() -> None:
    """A fall of 1.5 % is too small by default, and not for a policy that asks for one per cent."""
    small = replace(REAL, training=0.015, validation=0.015)

    assert "limit -2.0 %" in small.refusal
    assert replace(small, policy=SelectionPolicy(least_fall=0.01)).passed


@pytest.mark.parametrize("log_odds", [-5.0, 0.0, 2.9])
def test_runs_left_out_that_hardly_prefer_it_refuse_an_effect(log_odds: float) -> None:
    """Nothing is to be gained there, since training runs are the louder ones; e^3 to 1 is asked."""
    idle = replace(REAL, validation=0.0006, possible=-0.15, log_odds=log_odds)

    assert "not confirmed by the validation runs" in idle.refusal
    assert replace(idle, log_odds=3.1).passed


def test_an_event_of_one_training_run_is_not_asked_of_other_runs() -> None:
    """They only must not get worse by a quarter of what that run gains."""
    event = replace(REAL, validation=0.0, possible=0.0, log_odds=0.0, local=True)

    assert event.passed
    assert not replace(event, validation=-0.1).passed


def test_a_candidate_without_finite_normal_equations_is_refused_and_said() -> None:
    """Its score is infinite and its probability zero; numpy's least squares raised for it."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    broken = replace(fit.equations, matrix=np.full_like(fit.equations.matrix, np.nan))
    declared, candidate = (
        EvaluatedModel(fit, 1.0),
        EvaluatedModel(replace(fit, equations=broken), 1.0),
    )

    assert candidate.criteria(declared, tried=100).refusal == UNCOMPUTED
    assert probabilities(scores_of([declared, candidate])).tolist() == pytest.approx([1.0, 0.0])
    assert probabilities([np.inf, np.inf]).tolist() == pytest.approx([1.0, 0.0])


def test_what_keeps_a_model_from_running_away_is_needed() -> None:
    """Without it the model cannot be simulated: it passes, and the other is never preferred."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    alone = EvaluatedModel(replace(fit, cost=np.inf, converged=False), 1.0)
    mended = EvaluatedModel(fit, 1.0)

    assert mended.criteria(alone, tried=100).passed
    assert scores_of([mended, alone])[0] < scores_of([mended, alone])[1]
    coloured = replace(mended, fraction=0.2)
    assert scores_of([coloured, alone])[0] == scores_of([coloured])[0]


def test_a_fit_that_starts_where_nothing_can_be_simulated_says_so() -> None:
    """An inertia of nothing: the speed is infinite at once."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    position = fit.position.copy()
    position[fit.coordinates.names.index("J")] = -1e4

    lost = solve(fit.simulator, fit.coordinates, position)

    assert lost.cost == np.inf
    assert not lost.converged


def test_a_model_that_runs_away_is_begun_again_at_the_declared_parameters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first fit without the term is lost; the second begins where the declared model ended."""
    hidden = make_campaign("servo_150w", ["coulomb_friction"], seed=5, rows=800, training=2)
    runs = records_of_bench(hidden)
    work = Trials(runs)
    declared = work.evaluate(fit_declared(runs.training, "zoh"))
    score = next(s for s in work.scores(declared) if s.candidate.term.name == "coulomb_friction")
    current = work.evaluate(work.refits(declared, [score])[0][1])
    del work._evaluated[frozenset()]
    work._evaluated[frozenset()] = replace(declared, fit=replace(declared.fit, converged=False))
    begun: list[Fit] = []

    def lost_once(fit: Fit, name: str, limits: TerminationLimits) -> Fit:
        begun.append(fit)
        found = refitted_without(fit, name, limits)
        return replace(found, cost=np.inf) if len(begun) == 1 else found

    monkeypatch.setattr(trials, "refitted_without", lost_once)
    simpler = work.without(current, current.fit.simulator.model.terms[0])

    assert np.isfinite(simpler.fit.cost)
    np.testing.assert_allclose(begun[1].values[:7], declared.fit.values, rtol=1e-9)
    assert not np.allclose(begun[0].values[:7], declared.fit.values, rtol=1e-3)


def test_nothing_is_screened_beside_a_model_that_runs_away() -> None:
    """Its residuals are infinite, so that every score would be nonsense."""
    runs = records_of_bench(make_campaign("servo_150w", seed=5, rows=800, training=2))
    work = Trials(runs)
    lost = replace(fit_declared(runs.training, "zoh"), cost=np.inf, converged=False)

    judged = work.evaluate(lost)

    assert judged.unseen is None
    assert work.scores(judged) == []


def test_the_times_of_an_event_count_twice_by_chance() -> None:
    """A load has a size and two times; of 4500 samples each time takes another half logarithm."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    simpler = EvaluatedModel(fit, 1.0)
    load = LoadStep(0, 0.1, 2e-3, 1.5)
    loaded = refitted_with(fit, load, [Start(np.array([0.001, 0.3, 0.6]))])

    criteria = EvaluatedModel(loaded, 1.0).criteria(simpler, tried=100)

    samples = fit.weighting.counts.sum()
    assert criteria.needed == pytest.approx(0.5 * 5 * np.log(samples) + np.log(100))


def test_a_model_that_predicts_worse_is_told() -> None:
    """Errors on runs left out that are a tenth larger, and alike."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    square, count = np.array([0.01, 1.0]), np.array([1500.0, 1500.0])
    one = EvaluatedModel(fit, 1.0, ValidationErrors(square, count, np.zeros(2)))
    other = EvaluatedModel(fit, 1.0, ValidationErrors(1.21 * square, count, np.zeros(2)))

    assert other.predicts_worse(one, DEFAULT)
    assert not one.predicts_worse(other, DEFAULT)
    assert not one.predicts_worse(one, DEFAULT)
    assert not EvaluatedModel(fit, 1.0).predicts_worse(one, DEFAULT)


def test_a_richer_form_of_a_law_may_be_small_but_not_by_chance() -> None:
    """It claims nothing new: half a per cent is enough, if it is far from chance and foretold."""
    small = replace(REAL, training=0.005, validation=0.1)

    assert not small.passed
    assert small.refines
    assert not replace(small, gain=11.0).refines
    assert not replace(small, validation=-0.01).refines


def test_a_second_body_that_is_warm_within_a_sample_is_no_heat() -> None:
    """A loss with the square of the current was taken for heat of a millisecond; ten are asked."""
    declared = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    heated = SelfHeating(power_size=10.0, fastest=0.01, slowest=100.0)
    single = refitted_with(declared, heated, [Start(np.array([1.0, 1.0]))], TerminationLimits(1))
    richer = refitted_as(single, replace(heated, bodies=2), TerminationLimits(1))
    at = richer.coordinates.names.index("self_heating.quickness")

    def flaw(quick: float) -> str:
        position = richer.position.copy()
        position[at] = np.log(quick / richer.values[at - 2])
        assert richer.coordinates.names[at - 2] == "self_heating.time_constant"
        judged = EvaluatedModel(replace(richer, position=position), 1.0)
        return judged.criteria(EvaluatedModel(single, 1.0), tried=1).flaw

    assert "time constant 1 ms, expected at least 10 ms" in flaw(1e-3)
    assert flaw(2e-2) == ""
