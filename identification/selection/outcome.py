"""Result of a search: accepted effects, alternatives and examined candidates."""

from __future__ import annotations

from dataclasses import dataclass

from identification.fit.solve import Fit
from identification.selection.evidence import Gates
from identification.selection.omitted import OmittedTerm
from identification.selection.tracing import Trace

__all__ = ["Alternative", "Found", "Outcome", "Searched"]


@dataclass(frozen=True)
class Alternative:
    """Another effect type in place of an accepted effect.

    Args:
        name: Effect type.
        probability: Posterior probability of the model with it [-].
    """

    name: str
    probability: float


@dataclass(frozen=True)
class Found:
    """An effect of the final model.

    Args:
        name: Effect type.
        probability: Posterior probability against the alternatives [-].
        gates: Acceptance criteria against the model without the effect.
        alternatives: Other effect types in its place, the most probable first.
    """

    name: str
    probability: float
    gates: Gates
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True)
class Searched:
    """One examined candidate.

    Args:
        name: Effect type.
        round: Number of the round, from 1.
        promised: Predicted gain of the log likelihood; for an extended variant the achieved gain.
        gates: Acceptance criteria after the refit; None without a refit.
        chosen: Whether the candidate was accepted in that round.
        detail: Variant of the effect type, for example the channel or the run.
        flaw: Why the candidate could not be computed; empty if it could.
    """

    name: str
    round: int
    promised: float
    gates: Gates | None
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
