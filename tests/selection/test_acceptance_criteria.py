"""Acceptance criteria of an effect: significance, size and prediction of the validation runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from bench import make_campaign
from benchmarks.coverage import run_of
from identification.effects.load import LoadStep
from identification.effects.thermal import SelfHeating
from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.fit.evaluate import Simulated, simulate_most_alike
from identification.fit.solve import Fit, TerminationLimits, solve
from identification.model.excitation import Record, records_of
from identification.selection import trials, validation
from identification.selection.criteria import AcceptanceCriteria
from identification.selection.evidence import (
    UNCOMPUTED,
    EvaluatedModel,
    evaluated,
    probabilities,
    scores_of,
)
from identification.selection.policy import DEFAULT, SelectionPolicy
from identification.selection.refit import refitted_as, refitted_with, refitted_without
from identification.selection.search import search
from identification.selection.start import Start
from identification.selection.trials import Trials
from identification.selection.validation import ValidationErrors
from tests.effects.hidden import records_of_bench
from tests.motors import campaign, motor_named

SERVO = motor_named("servo 100 W")

REAL = AcceptanceCriteria(
    gain=900.0, needed=12.0, training=0.3, validation=0.25, possible=0.3, log_odds=80.0, local=False
)


def test_an_effect_that_all_runs_support_passes() -> None:
    """Gain far above chance, error more than 2 % smaller, validation runs predicted better."""
    assert REAL.passed


def test_the_limits_of_the_criteria_are_those_of_the_policy() -> None:
    """A fall of 1.5 % fails the default limit of 2 % and passes a limit of 1 %."""
    small = replace(REAL, training=0.015, validation=0.015)

    assert "limit -2.0 %" in small.refusal
    assert replace(small, policy=SelectionPolicy(least_fall=0.01)).passed


def test_an_effect_that_changes_the_validation_runs_more_than_the_training_runs_is_large() -> None:
    """The parameters absorb a lag of the magnet in the training runs, and not in other ones."""
    absorbed = replace(REAL, training=0.015, validation=0.2)

    assert absorbed.passed
    assert "too small" in replace(absorbed, expected=1.0).refusal
    assert "too small" in replace(absorbed, validation=None).refusal


@pytest.mark.parametrize("log_odds", [-5.0, 0.0, 2.9])
def test_validation_runs_that_hardly_prefer_an_effect_refuse_it(log_odds: float) -> None:
    """Only the training runs leave room for a fall; odds of e^3 to 1 are required instead."""
    idle = replace(REAL, validation=0.0006, possible=-0.15, log_odds=log_odds)

    assert "not confirmed by the validation runs" in idle.refusal
    assert replace(idle, log_odds=3.1).passed


def test_validation_runs_that_cannot_show_an_effect_must_not_contradict_it() -> None:
    """Odds of e^0.8 in the mean scatter by 1.3; three times that below, they contradict."""
    idle = replace(REAL, validation=-0.0003, possible=0.1, log_odds=-0.1, expected=0.8)

    assert idle.passed
    assert not idle.is_judged
    assert "not confirmed by the validation runs" in replace(idle, log_odds=-3.0).refusal
    assert "not confirmed by the validation runs" in replace(idle, validation=-0.003).refusal
    assert "not confirmed by the validation runs" in replace(idle, expected=3.1).refusal


def test_the_odds_of_an_effect_that_the_motor_has_are_those_that_are_expected() -> None:
    """The mean over 400 validation runs, each with noise and a difference of both models."""
    rng = np.random.default_rng(1)
    (run,) = campaign(SERVO, seed=1, runs=1, rows=300)
    (record,) = records_of([run])
    change = 0.1 * np.sin(np.arange(600.0)).reshape(300, 2)
    expected, found = 0.5 * np.sum(change**2), []
    for _ in range(400):
        noise = rng.standard_normal((300, 2))
        full, simple = (ValidationErrors.of([(record, x)], 1.0) for x in (noise, noise + change))
        assert full.expected_log_odds(simple, np.ones(2)) == pytest.approx(expected, rel=1e-12)
        found.append(np.sum(0.5 * full.count * np.log(simple.square / full.square)))

    error = np.sqrt(2.0 * expected / len(found))
    assert abs(np.mean(found) - expected) < 4.0 * error


def test_a_short_validation_run_does_not_refuse_what_the_temperatures_of_training_show() -> None:
    """40 samples at 62 degC, midway, hardly show a friction that halves from 20 to 125 degC."""
    hidden = [("viscous_temperature", 0.5)]
    runs = make_campaign("wiper_60w", hidden, seed=2, rows=1000, training=3, validation=1)
    short = [replace(run, frame=run.frame.iloc[:40]) for run in runs.validation]
    both = campaign_of(
        [run_of(run, f"{k}.csv") for k, run in enumerate(runs.training)],
        [run_of(run, "unseen.csv") for run in short],
    )

    (found,) = search(fit_declared(both.training, "zoh"), both).effects

    assert found.name == "viscous_temperature"
    assert not found.criteria.is_judged


@pytest.mark.parametrize("training", [0.3, 1.0, 3.0, 10.0, np.inf])
def test_validation_runs_confirm_a_quarter_of_the_fraction_that_falls(training: float) -> None:
    """At most a quarter of the error, however small the training error becomes: ln(4 / 3)."""
    quarter = -np.log(1.0 - 0.25 * (1.0 - np.exp(-training)))
    large = replace(REAL, training=training, possible=training)

    assert quarter < np.log(4 / 3) + 1e-9
    assert replace(large, validation=quarter + 0.001).passed
    refusal = replace(large, validation=quarter - 0.01).refusal
    assert f"training runs by {-100 * (1.0 - np.exp(-training)):+.2f} %" in refusal


def test_an_event_of_one_training_run_is_not_required_in_other_runs() -> None:
    """The error of the other runs may grow by at most a quarter of the gain of that run."""
    event = replace(REAL, validation=0.0, possible=0.0, log_odds=0.0, local=True)

    assert event.passed
    assert not replace(event, validation=-0.1).passed


def test_a_zero_error_of_each_run_may_be_small_in_the_validation_runs() -> None:
    """A fall of 1 % there is enough if it is no chance; 30 % in training predict 7.5 % else."""
    zero = replace(REAL, validation=0.01, log_odds=40.0, varies=True)

    assert zero.passed
    assert not replace(zero, varies=False).passed
    assert not replace(zero, log_odds=2.9).passed


def test_a_candidate_without_finite_normal_equations_is_refused_with_a_reason() -> None:
    """The score is infinite and the probability zero; numpy's least squares would raise."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    broken = replace(fit.equations, matrix=np.full_like(fit.equations.matrix, np.nan))
    declared, candidate = (
        EvaluatedModel(fit, 1.0),
        EvaluatedModel(replace(fit, equations=broken), 1.0),
    )

    assert candidate.criteria(declared, tried=100).refusal == UNCOMPUTED
    assert probabilities(scores_of([declared, candidate])).tolist() == pytest.approx([1.0, 0.0])
    assert probabilities([np.inf, np.inf]).tolist() == pytest.approx([1.0, 0.0])


def test_a_term_that_stabilises_the_model_is_kept() -> None:
    """The simulation diverges without the term, so the model with it is always preferred."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    alone = EvaluatedModel(replace(fit, cost=np.inf, converged=False), 1.0)
    mended = EvaluatedModel(fit, 1.0)

    assert mended.criteria(alone, tried=100).passed
    assert scores_of([mended, alone])[0] < scores_of([mended, alone])[1]
    coloured = replace(mended, fraction=0.2)
    assert scores_of([coloured, alone])[0] == scores_of([coloured])[0]


def _with_friction() -> tuple[Trials, EvaluatedModel, EvaluatedModel]:
    """Trials of a servo with dry friction, its nominal model, and the model with the friction."""
    hidden = make_campaign("servo_150w", ["coulomb_friction"], seed=5, rows=800, training=2)
    runs = records_of_bench(hidden)
    work = Trials(runs)
    declared = work.evaluate(fit_declared(runs.training, "zoh"))
    score = next(s for s in work.scores(declared) if s.candidate.term.name == "coulomb_friction")
    return work, declared, work.evaluate(work.refits(declared, [score])[0][1])


def test_a_term_without_which_a_validation_run_diverges_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An infinite validation error confirms a term, and refuses one that causes it."""
    work, declared, current = _with_friction()
    runs = work.campaign

    def diverging(
        fit: Fit, records: Sequence[Record], *, whole: bool, most: float
    ) -> list[Simulated]:
        found = simulate_most_alike(fit, records, whole=whole, most=most)
        return [replace(each, logged=np.full_like(each.logged, np.nan)) for each in found]

    monkeypatch.setattr(validation, "simulate_most_alike", diverging)
    lost, worse = (evaluated(m.fit, runs, m.fraction) for m in (declared, current))

    assert current.criteria(declared, tried=10).passed
    assert current.criteria(lost, tried=10).passed
    assert not worse.criteria(declared, tried=10).passed
    assert scores_of([current, lost])[1] == np.inf


def test_a_fit_from_a_diverging_start_does_not_converge() -> None:
    """Without inertia the speed is infinite at once."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    position = fit.position.copy()
    position[fit.coordinates.names.index("J")] = -1e4

    lost = solve(fit.simulator, fit.coordinates, position)

    assert lost.cost == np.inf
    assert not lost.converged


def test_a_diverging_fit_is_repeated_from_the_nominal_parameters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first fit without the term diverges; the second starts from the nominal fit."""
    work, declared, current = _with_friction()
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


def test_no_candidate_is_screened_against_a_diverging_model() -> None:
    """The residuals are infinite, so no score is defined."""
    runs = records_of_bench(make_campaign("servo_150w", seed=5, rows=800, training=2))
    work = Trials(runs)
    lost = replace(fit_declared(runs.training, "zoh"), cost=np.inf, converged=False)

    judged = work.evaluate(lost)

    assert judged.unseen is None
    assert work.scores(judged) == []


def test_the_times_of_an_event_count_as_two_parameters_each() -> None:
    """A load step has an amplitude and two times: 1 + 2 * 2 half logarithms of the samples."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    simpler = EvaluatedModel(fit, 1.0)
    load = LoadStep(0, 0.1, 2e-3, 1.5)
    loaded = refitted_with(fit, load, [Start(np.array([0.001, 0.3, 0.6]))])

    criteria = EvaluatedModel(loaded, 1.0).criteria(simpler, tried=100)

    samples = fit.weighting.counts.sum()
    assert criteria.needed == pytest.approx(0.5 * 5 * np.log(samples) + np.log(100))


def test_a_model_that_predicts_worse_is_detected() -> None:
    """Errors on the validation runs that are 10 % larger, and equal ones."""
    fit = fit_declared(records_of(campaign(SERVO, seed=1)), "zoh")
    square, count = np.array([0.01, 1.0]), np.array([1500.0, 1500.0])
    one = EvaluatedModel(fit, 1.0, ValidationErrors(square, count, np.zeros(2)))
    other = EvaluatedModel(fit, 1.0, ValidationErrors(1.21 * square, count, np.zeros(2)))

    assert other.predicts_worse(one, DEFAULT)
    assert not one.predicts_worse(other, DEFAULT)
    assert not one.predicts_worse(one, DEFAULT)
    assert not EvaluatedModel(fit, 1.0).predicts_worse(one, DEFAULT)


def test_a_richer_form_of_a_law_may_be_small_but_not_by_chance() -> None:
    """A richer form is no new effect: 0.5 % suffices if it is significant and predicts."""
    small = replace(REAL, training=0.005, validation=0.01)

    assert not small.passed
    assert small.refines
    assert not replace(small, gain=11.0).refines
    assert not replace(small, validation=-0.01).refines


def test_a_second_body_that_is_warm_within_a_sample_is_no_heat() -> None:
    """A time constant below ten milliseconds is implausible for heat."""
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
