"""Restriction of a law to some runs of a campaign."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from identification.model.term import Expression, Signals

__all__ = ["in_runs"]


def in_runs(signals: Signals, runs: Sequence[int]) -> Expression:
    """Factor that is one in these runs and zero elsewhere; one everywhere without runs [-]."""
    if not runs:
        return ca.SX(1)
    return sum((ca.fabs(signals.run - one) < 0.5 for one in runs), ca.SX(0))
