"""The colour of a residual: which frequencies it is made of, from a short autoregression.

A sample autocorrelation is noisy at every lag, and sums over it drown in that noise.  An
autoregression of the order that Akaike's criterion picks is smooth and stable:

    e(t) = sum_i a_i e(t-i) + white noise

White noise gets order zero in most cases, and then everything here is exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

__all__ = ["autoregression", "effective_samples", "spectrum"]

Array = NDArray[np.float64]


def autoregression(residual: Array) -> Array:
    """Coefficients of the autoregression, by Levinson's recursion on the biased covariance.

    The biased covariance makes every order stable, which least squares does not promise.

    Args:
        residual: (n_sample,) any unit; its mean is not taken away.

    Returns:
        (n_order,) coefficients a_i [-]; empty for white noise.

    Source:
        H. Akaike, IEEE Trans. Autom. Control 19 (1974) 716-723.
    """
    size = residual.size
    highest = min(int(10.0 * np.log10(size)), size // 4)
    covariance = _covariance(residual, highest)
    best = coefficients = np.zeros(0)
    innovation = covariance[0]
    if innovation <= 0.0:
        return best
    lowest = size * np.log(innovation)
    for order in range(1, highest + 1):
        predicted = float(coefficients @ covariance[order - 1 : 0 : -1])
        reflection = (covariance[order] - predicted) / innovation
        coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
        innovation *= 1.0 - reflection**2
        if innovation <= 1e-12 * covariance[0]:
            return coefficients
        criterion = size * np.log(innovation) + 2.0 * order
        if criterion < lowest:
            lowest, best = criterion, coefficients
    return best


def spectrum(coefficients: Array, length: int) -> Array:
    """Spectrum of an autoregression on the Fourier grid.

    Args:
        coefficients: (n_order,) as from `autoregression` [-].
        length: Number of frequencies, from zero once around the circle.

    Returns:
        (length,) power, scaled to a mean of 1: the sum of the correlations at frequency zero [-].
    """
    transfer = fft.fft(np.concatenate(([1.0], -coefficients)), length)
    power = 1.0 / np.abs(transfer) ** 2
    return np.asarray(power / power.mean(), dtype=np.float64)


def effective_samples(residual: Array) -> float:
    """Number of independent samples that say as much about a mean as this residual.

        n / sum_j rho(j) = n / S(0),   S the spectrum of mean 1

    Args:
        residual: (n_sample,) any unit.

    Returns:
        Effective number of samples, at least 1 [-].
    """
    length = fft.next_fast_len(max(2 * residual.size, 4096))
    power = spectrum(autoregression(residual), length)
    return float(max(residual.size / power[0], 1.0))


def _covariance(residual: Array, max_lag: int) -> Array:
    """Biased covariance (max_lag + 1,) at lags from zero on."""
    length = fft.next_fast_len(residual.size + max_lag, real=True)
    power = np.abs(fft.rfft(residual, length)) ** 2
    return np.asarray(fft.irfft(power, length)[: max_lag + 1] / residual.size, dtype=np.float64)
