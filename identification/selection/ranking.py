"""Ranking of models by the comparison criterion, with ties decided by the catalogue.

Models whose criterion differs by less than 1 are tied (see `evidence`); the model with the most
common effect types then comes first.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import effects_of
from identification.fit.solve import Fit
from identification.selection.evidence import EvaluatedModel, scores_of
from identification.selection.policy import SelectionPolicy

__all__ = ["is_better", "is_at_bound", "ranked", "replaces"]


def ranked(models: Sequence[EvaluatedModel], policy: SelectionPolicy) -> list[int]:
    """Indices of the models, best first; ties are decided by the catalogue, common types first."""
    scores = scores_of(models)
    best = min(scores, default=0.0)
    positions = {name: position for position, name in enumerate(CATALOGUE)}

    def key(k: int) -> tuple[float, float]:
        alike = scores[k] < best + policy.tie
        terms = models[k].fit.simulator.model.terms
        places = [positions.get(term.name, np.inf) for term in terms]
        return (best, float(sum(places))) if alike else (scores[k], 0.0)

    return sorted(range(len(models)), key=key)


def is_better(one: EvaluatedModel, other: EvaluatedModel) -> bool:
    """Whether the criterion prefers one model to another."""
    scores = scores_of([one, other])
    return scores[0] < scores[1]


def replaces(curve: EvaluatedModel, listed: EvaluatedModel, policy: SelectionPolicy) -> bool:
    """Whether a curve replaces the effects of the catalogue.

    The curve has to rank better, and its validation error must not be clearly larger.  In place of
    a single effect it also has to lower the error by the size limit, because a free curve that fits
    only as well as an effect is that effect.  The size limit does not apply if the effect has a
    shape parameter at its bound.
    """
    if curve.predicts_worse(listed, policy):
        return False
    fall = np.log(listed.fit.weighting.deviation / curve.fit.weighting.deviation)
    is_only = len(listed.fit.simulator.model.terms) == 1
    must_be_smaller = is_only and not is_at_bound(listed.fit, policy)
    is_small = float(np.sum(fall)) < policy.least_fall
    return is_better(curve, listed) and not (must_be_smaller and is_small)


def is_at_bound(fit: Fit, policy: SelectionPolicy) -> bool:
    """Whether a defining shape parameter of an effect may lie beyond a bound of its range.

    Example: a drag at the largest allowed exponent is more curved than real drag.  The data require
    another law, with which the drag is confounded.
    """
    at = {name: k for k, name in enumerate(fit.coordinates.names)}
    shapes = [
        at[f"{term.name}.{name}"]
        for term in effects_of(fit.simulator.model.terms)
        for name in term.defining
    ]
    if not shapes:
        return False
    lower, position, upper = (
        side[shapes] for side in (fit.coordinates.lower, fit.position, fit.coordinates.upper)
    )
    spread = np.sqrt(np.diag(fit.equations.covariance())[shapes])
    margin = np.maximum(policy.bound_range * (upper - lower), policy.bound_sd * spread)
    return bool(np.any(np.minimum(position - lower, upper - position) < margin))
