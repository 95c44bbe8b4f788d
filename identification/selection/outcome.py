"""Result of a search: accepted effects, alternatives and examined candidates."""

from __future__ import annotations

from dataclasses import dataclass

from identification.fit.solve import Fit
from identification.selection.evidence import AcceptanceCriteria
from identification.selection.omitted import OmittedTerm
from identification.selection.tracing import Trace

__all__ = ["Alternative", "Found", "Outcome", "Searched"]


@dataclass(frozen=True)
class Alternative:
    """Another effect type in place of an accepted effect.

    Args:
        name: Effect type.
        probability: Posterior probability of the model with it [-].
        fit: Fit of the model with it in place of the accepted effect.
        fraction: Effective sample fraction of that fit [-].
    """

    name: str
    probability: float
    fit: Fit
    fraction: float


@dataclass(frozen=True)
class Found:
    """An effect of the final model.

    Args:
        name: Effect type.
        probability: Posterior probability against the alternatives [-].
        criteria: Acceptance criteria against the model without the effect.
        alternatives: Other effect types in its place, the most probable first.
    """

    name: str
    probability: float
    criteria: AcceptanceCriteria
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True)
class Searched:
    """One examined candidate.

    Args:
        name: Effect type.
        round: Number of the round, from 1.
        predicted_gain: Predicted gain of the log likelihood; achieved gain of an extended variant.
        criteria: Acceptance criteria after the refit; None without a refit.
        chosen: Whether the candidate was accepted in that round.
        detail: Variant of the effect type, for example the channel or the run.
        flaw: Why the candidate could not be computed; empty if it could.
    """

    name: str
    round: int
    predicted_gain: float
    criteria: AcceptanceCriteria | None
    chosen: bool
    detail: str = ""
    flaw: str = ""


@dataclass(frozen=True)
class Outcome:
    """Result of a search.

    Args:
        fit: Fit of the final model.
        effects: Its effects, the largest gain first.
        searched: All examined candidates.
        complete: Whether the search ended by itself and not because its budget was spent.
        traces: Curves of what the nominal model lacks over single signals, best first; empty if no
            effect was accepted.
        omitted: Terms outside the final model with a predicted gain above chance.
    """

    fit: Fit
    effects: tuple[Found, ...]
    searched: tuple[Searched, ...]
    complete: bool = True
    traces: tuple[Trace, ...] = ()
    omitted: tuple[OmittedTerm, ...] = ()
