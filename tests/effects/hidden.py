"""Records of a bench simulation for the search."""

from __future__ import annotations

from bench import Campaign as Measured
from benchmarks.coverage import run_of
from identification.fit.campaign import Campaign, campaign_of

__all__ = ["records_of_bench"]


def records_of_bench(measured: Measured) -> Campaign:
    """The runs as the reader returns them."""
    return campaign_of(
        [run_of(run, f"t{k}.csv") for k, run in enumerate(measured.training)],
        [run_of(run, f"v{k}.csv") for k, run in enumerate(measured.validation)],
    )
