"""Residual correlation analysis, pooled over all runs of one role."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import bdtrc

from identification.arrays import Array, Index
from identification.diagnosis.residual import (
    Correlation,
    Errors,
    autocorrelation,
    cross_correlation,
    pooled_errors,
    whiteness,
)
from identification.result.report_data import RunTraces

__all__ = [
    "Correlation",
    "ResidualCheck",
    "channel_errors",
    "channel_whiteness",
    "coloured_channels",
    "gaps",
    "residual_checks",
]

_CHANCE = 1e-4
"""False alarm rate of the test for an autocorrelated residual, for each channel [-]."""
_SHORTEST = 8
"""Shortest segment that is used [samples]; shorter ones carry no information on lags."""


class ResidualCheck(NamedTuple):
    """Residual correlations of one channel over all runs of one role."""

    channel: str
    """``current`` or ``speed``."""
    plots: list[tuple[str, Correlation, Correlation | None]]
    """Title, and correlation of the final and of the nominal model: first the autocorrelation, then
    the cross-correlation with the voltage.  None if the nominal model is the final one."""


def residual_checks(runs: Sequence[RunTraces]) -> list[ResidualCheck]:
    """Pooled residual correlations of current and speed; channels without data are omitted."""
    checks = []
    for channel in ("current", "speed"):
        after = _pieces(runs, channel, "after")
        if not after[0]:
            continue
        has_before = all(getattr(run, f"before_{channel}") is not None for run in runs)
        before = _pieces(runs, channel, "before") if has_before else None
        own = f"Autocorrelation of the {channel} residual"
        cross = f"Cross-correlation of the {channel} residual with the voltage"
        plots = [
            (own, autocorrelation(after[0]), autocorrelation(before[0]) if before else None),
            (cross, cross_correlation(*after), cross_correlation(*before) if before else None),
        ]
        checks.append(ResidualCheck(channel, plots))
    return checks


def coloured_channels(checks: Sequence[ResidualCheck]) -> list[str]:
    """Channels whose final residual is significantly autocorrelated.

    A binomial test counts the lags outside the confidence band; the size of the correlation does
    not enter.  Over a million samples, a correlation of 0.003 at one lag is significant but
    irrelevant.
    """
    coloured = []
    for channel, ((_, own, _), _) in checks:
        count = own.lags.size
        # Survival function of the binomial distribution; scipy.stats takes 0.5 s to import.
        if bdtrc(round(own.outside * count) - 1, count, 1.0 - own.level) < _CHANCE:
            coloured.append(channel)
    return coloured


def channel_whiteness(run: RunTraces, channel: str) -> float | None:
    """P value of the whiteness of one run's residual; None if the run is too short."""
    residuals, _ = _pieces([run], channel, "after")
    return whiteness(residuals) if residuals else None


def channel_errors(run: RunTraces, channel: str) -> Errors | None:
    """Simulation error of one run by the final model; None if no sample of the channel was used."""
    residual = _residual(run, channel, "after")
    used = np.isfinite(residual)
    measured: Array = getattr(run, f"measured_{channel}")
    return pooled_errors([residual[used]], [measured[used]]) if used.any() else None


def gaps(time: Array) -> Index:
    """Indices (n_gap,) of the samples before a gap, where a line must break.

    A gap is longer than four median intervals of the time (n_sample,).
    """
    steps = np.diff(time)
    return np.flatnonzero(steps > 4.0 * np.median(steps)) if steps.size else np.zeros(0, np.int_)


def _residual(run: RunTraces, channel: str, stage: str) -> Array:
    measured: Array = getattr(run, f"measured_{channel}")
    simulated: Array = getattr(run, f"{stage}_{channel}")
    return measured - simulated


def _pieces(runs: Sequence[RunTraces], channel: str, stage: str) -> tuple[list[Array], list[Array]]:
    """Residuals and voltages of the segments between gaps of the record.

    An unused sample has no residual; it is set to zero, which removes it from all sums of products.
    """
    residuals: list[Array] = []
    voltages: list[Array] = []
    for run in runs:
        breaks = gaps(run.time) + 1
        left = np.nan_to_num(_residual(run, channel, stage), nan=0.0, posinf=0.0, neginf=0.0)
        pairs = zip(np.split(left, breaks), np.split(run.voltage, breaks), strict=True)
        for residual, voltage in pairs:
            if residual.size >= _SHORTEST:
                residuals.append(residual)
                voltages.append(voltage)
    return residuals, voltages
