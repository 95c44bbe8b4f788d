"""Simulation error of a channel: RMSE and NRMSE.

rmse  = sqrt(mean e^2)                                  e residual
nrmse = rmse / standard deviation of the measured channel
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array

__all__ = ["Errors", "pooled_errors"]


@dataclass(frozen=True)
class Errors:
    """Simulation error of one channel."""

    rmse: float
    """Root mean square error, in the unit of the channel."""
    nrmse: float
    """RMSE over the standard deviation of the measured channel [-]."""


def pooled_errors(residuals: Sequence[Array], measured: Sequence[Array]) -> Errors:
    """RMSE and NRMSE over all samples of several runs, one array (n_sample,) per run.

    Squares are summed over the runs.  The variance of each run is taken about its own mean, so that
    the difference between two steady speeds does not improve the NRMSE.

    Raises:
        ValueError: There are no samples.
    """
    squares = sum(float(np.sum(np.square(residual))) for residual in residuals)
    moved = sum(float(np.var(channel)) * channel.size for channel in measured)
    samples = sum(residual.size for residual in residuals)
    if samples == 0:
        raise ValueError(
            "no samples for a simulation error; expected at least one run with one row"
        )
    ratio = np.sqrt(squares / moved) if moved > 0.0 else (np.inf if squares > 0.0 else 0.0)
    return Errors(float(np.sqrt(squares / samples)), float(ratio))
