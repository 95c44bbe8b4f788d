"""Removal of effects from a model: decided by fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.effects.effect import effects_of
from identification.fit.solve import Fit, TerminationLimits
from identification.result.early_stop import early_stop_warnings
from identification.selection import search
from identification.selection import trials as trials_module
from identification.selection.evidence import EvaluatedModel
from identification.selection.outcome import Outcome
from identification.selection.refit import refitted_without
from identification.selection.steps import State
from identification.selection.trials import Trials
from identification.work import Budget
from tests.selection.extended import extended, frictions


def test_a_removal_that_is_undecided_is_fitted_after_the_budget_is_spent() -> None:
    """Coulomb friction is hidden; without the drag its fit reaches the cost of its model alone."""
    trials, declared, best = frictions()
    (drag,) = trials.finish_best(declared, trials.refits(declared, [best["quadratic_drag"]]))
    both = extended(trials, drag, "coulomb_friction")
    terms = {term.name: term for term in effects_of(both.fit.simulator.model.terms)}
    ((_, alone),) = Trials(trials.campaign).refits(declared, [best["coulomb_friction"]])
    trials.budget = Budget(-1.0)

    without_drag = trials.without(both, terms["quadratic_drag"])

    assert without_drag.fit.converged
    assert without_drag.fit.cost < alone.cost + 1.0


def test_a_removal_at_a_worse_optimum_than_the_current_one_is_fitted_from_there() -> None:
    """Coulomb friction is hidden; its fit alone, found before, ended at twice the friction.

    The gains that were predicted there are not those of the optimum.
    """
    trials, declared, best = frictions()
    (drag,) = trials.finish_best(declared, trials.refits(declared, [best["quadratic_drag"]]))
    both = extended(trials, drag, "coulomb_friction")
    terms = {term.name: term for term in effects_of(both.fit.simulator.model.terms)}
    friction = both.fit.by_name["coulomb_friction.torque"]
    far = both.fit.moved_to({**both.fit.by_name, "coulomb_friction.torque": 2.0 * friction})
    worse = refitted_without(far, "quadratic_drag", TerminationLimits(0))
    before = trials.evaluate(replace(worse, converged=True))
    predicted = trials.scores(before)[0].gain

    without_drag = trials.without(both, terms["quadratic_drag"])

    ((_, alone),) = Trials(trials.campaign).refits(declared, [best["coulomb_friction"]])
    assert without_drag.fit.cost < alone.cost + 1.0
    assert trials.scores(without_drag)[0].gain < 0.1 * predicted


def test_a_removal_that_is_stuck_where_it_began_is_fitted_from_the_nominal_parameters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Coulomb friction is hidden; without the drag its fit reaches the cost of its model alone."""
    trials, declared, best = frictions()
    (drag,) = trials.finish_best(declared, trials.refits(declared, [best["quadratic_drag"]]))
    both = extended(trials, drag, "coulomb_friction")
    terms = {term.name: term for term in effects_of(both.fit.simulator.model.terms)}
    ((_, alone),) = Trials(trials.campaign).refits(declared, [best["coulomb_friction"]])
    free = refitted_without

    def stuck(fit: Fit, name: str, limits: TerminationLimits) -> Fit:
        return free(fit, name, TerminationLimits(0) if fit is both.fit else limits)

    monkeypatch.setattr(trials_module, "refitted_without", stuck)
    monkeypatch.setattr(trials_module, "continued", lambda fit, limits: fit)

    without_drag = trials.without(both, terms["quadratic_drag"])

    assert without_drag.fit.cost < alone.cost + 1.0
    assert not both.is_undecided(without_drag.fit)


def test_a_removal_that_is_stuck_above_a_model_it_contains_is_fitted_from_that_model(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without the friction, a drag that is not fitted again is worse than no drag."""
    trials, declared, best = frictions()
    (drag,) = trials.finish_best(declared, trials.refits(declared, [best["quadratic_drag"]]))
    both = extended(trials, drag, "coulomb_friction")
    terms = {term.name: term for term in effects_of(both.fit.simulator.model.terms)}
    del trials._evaluated[frozenset({("quadratic_drag", "")})]
    begun: list[Fit] = []

    def stuck(fit: Fit, name: str, limits: TerminationLimits) -> Fit:
        begun.append(replace(refitted_without(fit, name, TerminationLimits(0)), converged=True))
        return begun[-1]

    monkeypatch.setattr(trials_module, "refitted_without", stuck)

    without_friction = trials.without(both, terms["coulomb_friction"])

    assert begun[0].cost > declared.fit.cost + 100.0
    assert without_friction.fit.cost < declared.fit.cost + 1.0


def test_an_effect_whose_removal_no_fit_decides_is_at_most_as_probable_as_its_absence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without operations no fit shows how well the drag fits without the friction."""
    trials, declared, best = frictions()
    monkeypatch.setattr(Fit, "may_reach", lambda *_: True)
    ((_, fit),) = trials.refits(declared, [best["quadratic_drag"]])
    both = extended(trials, EvaluatedModel(fit, 1.0), "coulomb_friction")
    trials.longest, trials.budget = 0.0, Budget(-1.0)

    effects, _ = search._explained(State(trials, declared, both))
    outcome = Outcome(replace(both.fit, converged=True), tuple(effects), ())
    (warning,) = early_stop_warnings(outcome.fit, outcome, None, "normal", None)

    found = {one.name: one.given(np.ones(2)) for one in effects}
    assert found["coulomb_friction"].probability <= 0.5
    assert warning.code == "search_incomplete"
    assert "the model without Coulomb friction" in warning.message
