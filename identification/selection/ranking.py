"""Ranking of models by the comparison criterion, with ties decided by the catalogue.

Models whose criterion differs by less than 1 are tied (see `evidence`); the model with the most
common effect types then comes first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import effects_of
from identification.fit.solve import Fit
from identification.selection.evidence import LEAST_SIZE, EvaluatedModel, scores_of

__all__ = ["is_better", "is_strained", "ranked", "replaces"]

_ALIKE: Final = 1.0
"""Difference of the criterion below which models are tied."""
_AT: Final = 1e-3
"""Fraction of its range within which a shape parameter counts as at its bound."""
_WITHIN: Final = 2.0
"""Standard deviations within which a shape parameter counts as at its bound."""


def ranked(models: Sequence[EvaluatedModel]) -> list[int]:
    """Indices of the models, best first; ties are decided by the catalogue, common types first.

    Args:
        models: Models evaluated on the same campaign.
    """
    scores = scores_of(models)
    best = min(scores, default=0.0)
    positions = {name: position for position, name in enumerate(CATALOGUE)}

    def key(k: int) -> tuple[float, float]:
        alike = scores[k] < best + _ALIKE
        places = [positions.get(term.name, np.inf) for term in models[k].fit.simulator.model.terms]
        return (best, float(sum(places))) if alike else (scores[k], 0.0)

    return sorted(range(len(models)), key=key)


def is_better(one: EvaluatedModel, other: EvaluatedModel) -> bool:
    """Whether the criterion prefers one model to another."""
    scores = scores_of([one, other])
    return scores[0] < scores[1]


def replaces(alone: EvaluatedModel, listed: EvaluatedModel) -> bool:
    """Whether a curve replaces the effects of the catalogue.

    The curve has to rank better, and its validation error must not be clearly larger.  In place of
    a single effect it also has to lower the error by the size limit, because a free curve that fits
    only as well as an effect is that effect.  The size limit does not apply if the effect has a
    shape parameter at its bound.
    """
    if alone.predicts_worse(listed):
        return False
    fall = np.log(listed.fit.weighting.deviation / alone.fit.weighting.deviation)
    must_be_smaller = len(listed.fit.simulator.model.terms) == 1 and not is_strained(listed.fit)
    return is_better(alone, listed) and not (must_be_smaller and float(np.sum(fall)) < LEAST_SIZE)


def is_strained(fit: Fit) -> bool:
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
    near = np.maximum(_AT * (upper - lower), _WITHIN * spread)
    return bool(np.any(np.minimum(position - lower, upper - position) < near))
