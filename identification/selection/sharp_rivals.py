"""Comparison of friction laws with a sharp sign.

In the search, the sign of friction is smoothed at standstill, where the shaft then creeps.  A law
with another shape at low speed, such as Stribeck friction, makes up for the creep and seems to fit
better than the true one.  Laws whose criteria are close are therefore compared by fits with a ten
times sharper sign, where either fit prefers it (`selection/sharpening.py`).
"""

from __future__ import annotations

from collections.abc import Sequence

from identification.effects.effect import AbstractEffect, effects_of
from identification.selection.evidence import EvaluatedModel, evaluated, scores_of
from identification.selection.score import key_of
from identification.selection.sharpening import sharpened
from identification.selection.steps import State

__all__ = ["with_sharp_signs"]


def with_sharp_signs(state: State, models: Sequence[EvaluatedModel]) -> list[EvaluatedModel]:
    """The models, the first and its close rivals with other friction with a sharp sign.

    A rival is close if it is not behind by more than the search allows a fit to fall behind.
    """
    if len(models) < 2:
        return list(models)
    scores, own = scores_of(models), _smoothed(models[0])
    slack = state.trials.policy.abandon_slack
    rivals = {
        k
        for k, model in enumerate(models)
        if _smoothed(model) != own and scores[k] < scores[0] + slack
    }
    sharp = rivals | {0} if rivals else set()
    return [_sharp(state, model) if k in sharp else model for k, model in enumerate(models)]


def _smoothed(model: EvaluatedModel) -> set[AbstractEffect]:
    """Terms whose sign at standstill is smoothed."""
    terms = effects_of(model.fit.simulator.model.terms)
    return {term for term in terms if term.sharper != term}


def _sharp(state: State, model: EvaluatedModel) -> EvaluatedModel:
    """The model with a sharp sign; itself if the sign makes no difference."""
    known = state.sharp.get(key_of(model.fit))
    if known is not None and known[0] is model:
        return known[1]
    fit = sharpened(model.fit)
    found = model
    if fit is not model.fit:
        found = evaluated(fit.light(), state.trials.campaign, model.fraction)
    state.sharp[key_of(model.fit)] = model, found
    return found
