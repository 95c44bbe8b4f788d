"""Search of a campaign whose last run is for validation."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from identification.fit.campaign import campaign_of
from identification.fit.declared import fit_declared
from identification.ingest import Run
from identification.selection.outcome import Outcome
from identification.selection.search import search


def outcome_of(runs: Sequence[Run], withheld: Collection[str] = ()) -> Outcome:
    """Outcome of the search with the last run for validation."""
    campaign = campaign_of(runs[:-1], runs[-1:])
    return search(fit_declared(campaign.training, "zoh"), campaign, withheld=withheld)
