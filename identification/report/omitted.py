"""Terms that the final model omits although they promise more than chance, in the result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.effects.omitted import OmittedTerm, consider_variances
from identification.fit.solve import Fit
from identification.quantities import DECLARED_PARAMETERS

__all__ = ["omitted_entries", "omitted_warnings"]

_NAMED = 4


def omitted_entries(final: Fit, omitted: Sequence[OmittedTerm]) -> list[dict[str, Any]]:
    """One entry of each term: what it promises and what it could change.

    Args:
        final: Fit of the final model.
        omitted: The terms.
    """
    slopes = dict(
        zip(final.coordinates.names, final.coordinates.slopes(final.position), strict=True)
    )
    return [
        {
            "name": term.name,
            "promised_log_likelihood_gain": term.gain,
            "log_likelihood_gain_by_chance": term.chance,
            "changes": {
                name: float(term.steps.get(name, 0.0) * slopes[name])
                for name in DECLARED_PARAMETERS
            },
        }
        for term in omitted
    ]


def omitted_warnings(final: Fit, omitted: Sequence[OmittedTerm]) -> list[str]:
    """That structure is left which no effect explains, and what it does to the intervals.

    Args:
        final: Fit of the final model.
        omitted: The terms.
    """
    # An unknown gain of a sensor is said where it is found.
    omitted = [term for term in omitted if term.gain is not None]
    if not omitted:
        return []
    spread = np.sqrt(consider_variances(final, omitted)) * final.coordinates.slopes(final.position)
    shares = {
        name: float(sd / abs(value))
        for name, sd, value in zip(final.coordinates.names, spread, final.values, strict=True)
        if name in DECLARED_PARAMETERS and value != 0.0
    }
    most = max(shares, key=lambda name: shares[name])
    names = ", ".join(term.name for term in omitted[:_NAMED])
    names += f" and {len(omitted) - _NAMED} more" if len(omitted) > _NAMED else ""
    return [
        "the residual holds structure that no effect explains: adding a term would improve the fit "
        f"by more than chance, but none passes the acceptance criteria ({names}); the intervals "
        "include what such a term could change, which is most for "
        f"{most}: {100 * shares[most]:.3g} % of its value (one standard deviation)"
    ]
