"""Simulation error: RMSE, NRMSE and fit percentage.

With the residual e of a channel:

    rmse   = sqrt(mean e^2)
    nrmse  = rmse / standard deviation of the measured channel
    fit    = 100 (1 - nrmse)   [%]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Errors", "fit_percent", "nrmse", "pooled_errors", "rmse"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """Simulation error of one channel.

    Args:
        rmse: Root mean square error, in the unit of the channel.
        nrmse: RMSE over the standard deviation of the measured channel [-].
    """

    rmse: float
    nrmse: float

    @property
    def fit_percent(self) -> float:
        """``100 (1 - nrmse)`` [%]: 100 is perfect, 0 is no better than the mean of the record."""
        return 100.0 * (1.0 - self.nrmse)


def rmse(residual: Array) -> float:
    """Root mean square of a residual (n_sample,), in its unit."""
    return float(np.sqrt(np.mean(np.square(residual))))


def nrmse(residual: Array, measured: Array) -> float:
    """RMSE over the standard deviation of the measured channel [-].

    Args:
        residual: (n_sample,) measured minus simulated.
        measured: (n_sample,) the channel, in the same unit.

    Returns:
        The ratio; infinite if the channel is constant and the residual is not zero.
    """
    return pooled_errors([residual], [measured]).nrmse


def fit_percent(residual: Array, measured: Array) -> float:
    """Fit percentage ``100 (1 - nrmse)`` [%].

    Args:
        residual: (n_sample,) measured minus simulated.
        measured: (n_sample,) the channel, in the same unit.

    Returns:
        100 for a perfect simulation, 0 for one no better than the mean, negative for worse.
    """
    return pooled_errors([residual], [measured]).fit_percent


def pooled_errors(residuals: Sequence[Array], measured: Sequence[Array]) -> Errors:
    """Simulation error of several runs together.

    Squares are summed over the runs.  The variance of each run is taken about its own mean, so that
    the difference between two steady speeds does not improve the NRMSE.

    Args:
        residuals: One array (n_sample,) per run, measured minus simulated.
        measured: The channel of the same runs, in the same unit.

    Returns:
        RMSE and NRMSE over all samples.

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
