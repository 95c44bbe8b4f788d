"""Proposal of training and validation runs.

A validation run is predicted by a model of the training runs.  The prediction says most about the
model if it is an interpolation, so the run is proposed whose removal narrows the ranges of the
training runs least.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

__all__ = ["ROLES", "proposed_roles"]

ROLES: Final = ("training", "validation")

_VALIDATION = re.compile(r"(?<![a-z])(valid|val(?![a-z])|test|holdout|check)", re.IGNORECASE)
_FEWEST = 3
"""Smallest number of runs of which one is set apart; with two, each has half of the information."""


class MeasuredRun(Protocol):
    """Run with its file name and the range of each channel."""

    @property
    def id(self) -> str:
        """ID of the run."""

    @property
    def file(self) -> str:
        """File name."""

    @property
    def channels(self) -> dict[str, Any]:
        """Smallest and largest value of each channel, `min` and `max`."""


def proposed_roles(runs: Sequence[MeasuredRun]) -> dict[str, str]:
    """Role of each run by ID: by its file name, or else the least extreme run validates.

    The runs are those of one motor in the order of recording.
    """
    named = {run.id for run in runs if _VALIDATION.search(run.file)}
    if not named or len(named) == len(runs):
        named = set()
        if len(runs) >= _FEWEST:
            # The latest of equals, as if the motor were predicted after the others were recorded.
            named = {min(reversed(runs), key=lambda run: _narrowing(run, runs)).id}
    return {run.id: ROLES[run.id in named] for run in runs}


def _narrowing(run: MeasuredRun, runs: Sequence[MeasuredRun]) -> float:
    """Relative loss of range of all channels if the run is removed, 0 to the number of channels."""
    others = [other for other in runs if other is not run]
    return sum(1.0 - _width(others, name) / (_width(runs, name) or 1.0) for name in run.channels)


def _width(runs: Sequence[MeasuredRun], name: str) -> float:
    found: list[Mapping[str, float]] = [r.channels[name] for r in runs if name in r.channels]
    if not found:
        return 0.0
    return max(entry["max"] for entry in found) - min(entry["min"] for entry in found)
