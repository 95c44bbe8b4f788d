"""How well a chain has mixed.

Source: Goodman and Weare, Comm. Appl. Math. Comput. Sci. 5 (2010), 65-80 (autocorrelation time of
an ensemble); Gelman et al., Bayesian Data Analysis, 3rd edition, section 11.4 (split R-hat).
"""

from __future__ import annotations

from dataclasses import dataclass

import emcee
import numpy as np
from numpy.typing import NDArray

__all__ = ["Convergence", "convergence_of", "split_r_hat"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Convergence:
    """Diagnostics of a chain after burn-in.

    Args:
        walkers: Number of walkers.
        steps: Steps of each walker.
        acceptance: Mean share of accepted proposals [-].
        autocorrelation_time: Largest over the dimensions [steps].
        ess_min: Smallest effective number of independent draws over the dimensions.
        r_hat_max: Largest split R-hat over the dimensions [-].
        reached: Whether the chain is as many autocorrelation times long as was asked.
    """

    walkers: int
    steps: int
    acceptance: float
    autocorrelation_time: float
    ess_min: float
    r_hat_max: float
    reached: bool


def convergence_of(chain: Array, acceptance: float, lengths: float) -> Convergence:
    """Diagnostics of a chain.

    Args:
        chain: (n_step, n_walker, n_dim) after burn-in.
        acceptance: Mean share of accepted proposals [-].
        lengths: Autocorrelation times the chain should be long.
    """
    steps, walkers, _ = chain.shape
    tau = np.maximum(emcee.autocorr.integrated_time(chain, tol=0), 1.0)
    longest = float(np.max(tau))
    return Convergence(
        walkers=walkers,
        steps=steps,
        acceptance=acceptance,
        autocorrelation_time=longest,
        ess_min=float(steps * walkers / longest),
        r_hat_max=float(np.max(split_r_hat(chain))),
        reached=bool(steps >= lengths * longest),
    )


def split_r_hat(chain: Array) -> Array:
    """Split R-hat of each dimension, every half of every walker counted as a chain.

    Args:
        chain: (n_step, n_walker, n_dim).

    Returns:
        (n_dim,) near one for a chain that has mixed [-].
    """
    half = chain.shape[0] // 2
    halves = np.concatenate([chain[:half], chain[half : 2 * half]], axis=1)
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = halves.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt((half - 1) / half + between / within)
    return np.where(within > 0, ratio, 1.0)
