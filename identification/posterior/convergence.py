"""MCMC convergence: integrated autocorrelation time and split R-hat.

A converged chain of 50 autocorrelation times has an expected split R-hat of 1.02 = sqrt(1 + 2 tau /
n), because each half of a walker is 25 autocorrelation times long and its mean scatters
accordingly.  The largest of ten dimensions, each estimated from about 64 means, exceeds the
expected excess by less than half.  A split R-hat up to 1.03 is therefore that of a converged chain;
the conventional 1.01 would require chains twice as long.

Source: Goodman and Weare, Comm. Appl. Math. Comput. Sci. 5 (2010), 65-80 (autocorrelation time of
an ensemble); Gelman et al., Bayesian Data Analysis, 3rd edition, section 11.4 (split R-hat).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import fft

from identification.arrays import Array

__all__ = [
    "LARGEST_R_HAT",
    "REQUIRED_LENGTH",
    "Convergence",
    "autocorrelation_times",
    "convergence_of",
    "split_r_hat",
]

LARGEST_R_HAT: Final = 1.03
"""Largest split R-hat of a converged chain [-]."""

REQUIRED_LENGTH: Final = 50.0
"""Least length of a converged chain [autocorrelation times]."""

_WINDOW: Final = 5.0
"""Width of the summation window in autocorrelation times; Sokal recommends four to ten."""


@dataclass(frozen=True)
class Convergence:
    """Convergence diagnostics of a chain after burn-in."""

    walkers: int
    steps: int
    """Steps of each walker."""
    acceptance: float
    """Mean fraction of accepted proposals [-]."""
    autocorrelation_time: float
    """Largest over the dimensions [steps]."""
    ess_min: float
    """Smallest effective sample size over the dimensions."""
    r_hat_max: float
    """Largest split R-hat over the dimensions [-]."""
    reached: bool
    """True if the chain has `REQUIRED_LENGTH`, and R-hat is at most `LARGEST_R_HAT`."""


def convergence_of(chain: Array, acceptance: float) -> Convergence:
    """Diagnostics of a chain (n_step, n_walker, n_dim), and its fraction of accepted proposals [-].

    The chain has no burn-in.
    """
    steps, walkers, _ = chain.shape
    tau = np.maximum(autocorrelation_times(chain), 1.0)
    longest = float(np.max(tau))
    r_hat = float(np.max(split_r_hat(chain)))
    return Convergence(
        walkers=walkers,
        steps=steps,
        acceptance=acceptance,
        autocorrelation_time=longest,
        ess_min=float(steps * walkers / longest),
        r_hat_max=r_hat,
        reached=bool(steps >= REQUIRED_LENGTH * longest and r_hat <= LARGEST_R_HAT),
    )


def autocorrelation_times(chain: Array) -> Array:
    """Integrated autocorrelation time (n_dim,) of an ensemble (n_step, n_walker, n_dim) [steps].

    Deviations are taken from the mean of all walkers.  Walkers that stay apart, or one that never
    moved, therefore lengthen the time.  For a dimension that never moved it is the length of the
    chain.

    Source:
        Sokal, Monte Carlo methods in statistical mechanics (1996), section 3, for the window;
        Goodman and Weare (2010), section 3.
    """
    steps = chain.shape[0]
    moved = np.moveaxis(chain - chain.mean(axis=(0, 1)), 0, -1)
    size = fft.next_fast_len(2 * steps, real=True)
    power = (np.abs(fft.rfft(moved, size, axis=-1)) ** 2).sum(axis=0)
    covariance = fft.irfft(power, size, axis=-1)[:, :steps]
    found = np.full(chain.shape[2], float(steps))
    for k in np.flatnonzero(np.ptp(chain, axis=(0, 1)) > 0.0):
        times = 2.0 * np.cumsum(covariance[k] / covariance[k, 0]) - 1.0
        beyond = np.flatnonzero(np.arange(steps) >= _WINDOW * times)
        found[k] = times[beyond[0] if beyond.size else -1]
    return found


def split_r_hat(chain: Array) -> Array:
    """Split R-hat (n_dim,) of a chain (n_step, n_walker, n_dim), near one if it has converged [-].

    Every half of every walker counts as one chain.
    """
    half = chain.shape[0] // 2
    halves = np.concatenate([chain[:half], chain[half : 2 * half]], axis=1)
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = halves.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt((half - 1) / half + between / within)
    return np.where(within > 0, ratio, 1.0)
