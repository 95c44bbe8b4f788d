"""Which of several models of one campaign is better, and whether one stands in another's place.

Models that differ by less than one in half their criterion are alike (see `evidence`); of those the
one with the commonest kinds comes first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.effects.catalogue import CATALOGUE
from identification.effects.evidence import LEAST_SIZE, Judged, scores_of
from identification.fit.solve import Fit

__all__ = ["is_better", "is_strained", "ranked", "replaces"]

_ALIKE: Final = 1.0
_PLACES: Final = {name: place for place, name in enumerate(CATALOGUE)}
_AT: Final = 1e-3
_WITHIN: Final = 2.0
"""Share of a range, and standard deviations, within which a shape is at its bound."""


def ranked(models: Sequence[Judged]) -> list[int]:
    """Places of models, best first; of those that are alike, the commonest kinds first.

    Args:
        models: The models, judged on the same campaign.
    """
    scores = scores_of(models)
    best = min(scores, default=0.0)

    def key(k: int) -> tuple[float, float]:
        alike = scores[k] < best + _ALIKE
        places = [_PLACES.get(term.name, np.inf) for term in models[k].fit.simulator.model.terms]
        return (best, float(sum(places))) if alike else (scores[k], 0.0)

    return sorted(range(len(models)), key=key)


def is_better(one: Judged, other: Judged) -> bool:
    """Whether the criterion prefers one model to another."""
    scores = scores_of([one, other])
    return scores[0] < scores[1]


def replaces(alone: Judged, listed: Judged) -> bool:
    """Whether a curve stands in the place of the effects of the catalogue.

    Of a single one only where the error is smaller by what counts as a size: a free form that does
    as well as a kind is that kind, unless the kind is strained.  Never where it predicts worse.
    """
    if alone.predicts_worse(listed):
        return False
    fall = np.log(listed.fit.weighting.deviation / alone.fit.weighting.deviation)
    must_be_smaller = len(listed.fit.simulator.model.terms) == 1 and not is_strained(listed.fit)
    return is_better(alone, listed) and not (must_be_smaller and float(np.sum(fall)) < LEAST_SIZE)


def is_strained(fit: Fit) -> bool:
    """Whether a shape that makes a kind what it is may lie beyond a bound of its range.

    A drag with the highest power that is one bends more than drags do: the data ask for another
    law, which happens to be imitated.
    """
    at = {name: k for k, name in enumerate(fit.coordinates.names)}
    shapes = [
        at[f"{term.name}.{name}"] for term in fit.simulator.model.terms for name in term.defining
    ]
    if not shapes:
        return False
    lower, position, upper = (
        side[shapes] for side in (fit.coordinates.lower, fit.position, fit.coordinates.upper)
    )
    spread = np.sqrt(np.diag(fit.equations.covariance())[shapes])
    near = np.maximum(_AT * (upper - lower), _WITHIN * spread)
    return bool(np.any(np.minimum(position - lower, upper - position) < near))
