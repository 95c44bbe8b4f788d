"""Repetition of the selection from other models, if the first path may have ended at surrogates."""

from __future__ import annotations

from collections.abc import Callable

from identification.checks.plausible import longest_electrical
from identification.fit.solve import Fit
from identification.selection.evidence import EvaluatedModel, is_better
from identification.selection.policy import SelectionPolicy
from identification.selection.steps import State, backward, enrich, forward
from identification.work import operations

__all__ = ["restart"]


def restart(state: State, has_structure: Callable[[State], bool]) -> None:
    """Repeat the selection from other models, and keep the best model.

    An inductance absorbs the lag of the current sensor, and an effect of the shaft what remains of
    the lags.  If the electrical time constant is implausible, the selection is repeated from the
    best model with a filter of the current in place of one effect.

    A flexible effect can absorb a second one.  Example: a Stribeck friction that is selected first
    also fits a dry friction, which then has no predicted gain.  If the dry friction is selected
    first, the Stribeck friction still has a predicted gain.  If the residual still has structure,
    the selection is repeated from the runner-up models of round 1.
    """
    if not state.current.fit.simulator.model.terms:
        return
    trials = state.trials
    if _is_slow(state.current.fit, trials.policy):
        began = operations()
        for lagged in _with_lag(state):
            _repeat(state, lagged)
        trials.budget.extend(operations() - began)
    if has_structure(state):
        for runner_up in trials.runners_up()[: trials.policy.runners]:
            _repeat(state, runner_up)


def _is_slow(fit: Fit, policy: SelectionPolicy) -> bool:
    """True if the electrical time constant is longer than that of any motor of this size.

    An inductance that the runs do not determine may be shorter.
    """
    values = fit.by_name
    deviation = float(fit.deviations[fit.coordinates.names.index("L")])
    return values["L"] - policy.bound_sd * deviation > values["Ra25"] * longest_electrical(values)


def _repeat(state: State, start: EvaluatedModel) -> None:
    trials = state.trials
    other = State(trials, state.nominal, start, state.searched)
    for _ in range(trials.policy.rounds - 1):
        if trials.budget.spent or not forward(other):
            break
        enrich(other)
    if other.current is not start and is_better(other.current, state.current):
        state.current = other.current
        backward(state)


def _with_lag(state: State) -> list[EvaluatedModel]:
    """The best model with a filter of the current in place of the effect that gains least."""
    trials, current = state.trials, state.current
    terms = current.fit.simulator.model.terms
    if any(term.name == "current_filter" for term in terms):
        return []
    simpler = min((trials.without(current, t) for t in terms), key=lambda model: model.fit.cost)
    scores = [s for s in trials.scores(simpler) if s.candidate.final.name == "current_filter"]
    best = {score.structure: score for score in reversed(scores)}
    return trials.finish_best(simpler, trials.refits(simpler, list(best.values())))[:1]
