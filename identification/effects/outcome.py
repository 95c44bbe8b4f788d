"""What a search found, and everything that it looked at."""

from __future__ import annotations

from dataclasses import dataclass

from identification.effects.evidence import Gates
from identification.effects.omitted import OmittedTerm
from identification.effects.tracing import Trace
from identification.fit.solve import Fit

__all__ = ["Alternative", "Found", "Outcome", "Searched"]


@dataclass(frozen=True)
class Alternative:
    """Another kind in the place of an effect.

    Args:
        name: The kind.
        probability: Posterior probability of the model with it.
    """

    name: str
    probability: float


@dataclass(frozen=True)
class Found:
    """An effect of the final model.

    Args:
        name: The kind.
        probability: Posterior probability against the alternatives in its place.
        gates: How it passed against the model without it.
        alternatives: Kinds that could stand in its place, most probable first.
    """

    name: str
    probability: float
    gates: Gates
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True)
class Searched:
    """One candidate that was looked at.

    Args:
        name: The kind.
        round: Number of the round, from 1.
        promised: Gain of the log likelihood that screening promised.
        gates: How it fared in the refit, None where it was not refitted.
        chosen: Whether it was taken in that round.
        detail: Which variant of the kind: the channel or the run it concerns.
        flaw: Why it could not be computed at all; empty where it could.
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
    """What the search found.

    Args:
        fit: Fit of the final model.
        effects: Its effects, strongest evidence first.
        searched: Everything that was looked at.
        complete: Whether it ended by itself and not because its time was up.
        traces: What the declared model lacks against the signals it may depend on, best first;
            empty where nothing was found.
        omitted: Terms that promise more than chance beside the final model and passed no gate.
    """

    fit: Fit
    effects: tuple[Found, ...]
    searched: tuple[Searched, ...]
    complete: bool = True
    traces: tuple[Trace, ...] = ()
    omitted: tuple[OmittedTerm, ...] = ()
