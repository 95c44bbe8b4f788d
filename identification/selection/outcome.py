"""Result of a search: accepted effects, alternatives and examined candidates."""

from __future__ import annotations

from dataclasses import dataclass

from identification.fit.solve import Fit
from identification.model.composite import MotorModel
from identification.selection.evidence import AcceptanceCriteria
from identification.selection.omitted import OmittedTerm
from identification.selection.tracing import Trace

__all__ = ["Alternative", "Found", "Outcome", "Searched"]


@dataclass(frozen=True)
class Alternative:
    """Another effect type in place of an accepted effect."""

    name: str
    """Effect type."""
    probability: float
    """Posterior probability of the model with it [-]."""
    fit: Fit
    """Fit of the model with it in place of the accepted effect."""
    fraction: float
    """Effective sample fraction of that fit [-]."""


@dataclass(frozen=True)
class Found:
    """An effect of the final model."""

    name: str
    """Effect type."""
    probability: float
    """Posterior probability against the alternatives [-]."""
    criteria: AcceptanceCriteria
    """Acceptance criteria against the model without the effect."""
    alternatives: tuple[Alternative, ...]
    """Other effect types in its place, the most probable first."""


@dataclass(frozen=True)
class Searched:
    """One examined candidate."""

    name: str
    """Effect type."""
    round: int
    """Number of the round, from 1."""
    predicted_gain: float
    """Predicted gain of the log likelihood; achieved gain of an extended variant."""
    criteria: AcceptanceCriteria | None
    """Acceptance criteria after the refit; None without a refit."""
    chosen: bool
    """Whether the candidate was accepted in that round."""
    detail: str = ""
    """Variant of the effect type, for example the channel or the run."""
    flaw: str = ""
    """Why the candidate could not be computed; empty if it could."""


@dataclass(frozen=True)
class Outcome:
    """Result of a search."""

    fit: Fit
    """Fit of the final model."""
    effects: tuple[Found, ...]
    """Its effects, the largest gain first."""
    searched: tuple[Searched, ...]
    """All examined candidates."""
    complete: bool = True
    """Whether the search ended by itself and not because its budget was spent."""
    traces: tuple[Trace, ...] = ()
    """Curves of what the nominal model lacks over single signals, best first; empty if no effect
    was accepted."""
    omitted: tuple[OmittedTerm, ...] = ()
    """Terms outside the final model with a predicted gain above chance."""
    smooth: MotorModel | None = None
    """The final model with the friction of the search, if that of `fit` is sharper."""
