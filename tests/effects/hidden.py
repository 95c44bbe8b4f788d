"""Records of a bench simulation for the search, and the kinds among which it has to choose."""

from __future__ import annotations

from bench import Campaign as Measured
from benchmarks.coverage import run_of
from identification.effects.catalogue import CATALOGUE
from identification.fit.campaign import Campaign, campaign_of

__all__ = ["all_but", "records_of_bench"]


def records_of_bench(measured: Measured) -> Campaign:
    """The runs as the reader returns them."""
    return campaign_of(
        [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)],
        [run_of(run, f"v{k}.csv") for k, run in enumerate(measured.validation)],
    )


def all_but(*rivals: str) -> set[str]:
    """Kinds of the catalogue that a search withholds, so that it has to choose among `rivals`.

    The rivals are the effects with a similar signature; a search without the others is faster.
    Tests of the search use the whole catalogue.
    """
    assert CATALOGUE.keys() >= set(rivals)
    return CATALOGUE.keys() - set(rivals)
