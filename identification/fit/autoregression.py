"""Autoregressive model of a residual: whitening filter and power spectrum.

    e(t) + c_1 e(t-1) + ... + c_p e(t-p) = white noise

The filter is always given as its taps (1, c_1, ..., c_p), as `scipy.signal.lfilter` takes them.

Source: Ljung, System Identification, 2nd edition, section 16.4 (order selection); Akaike, IEEE
Trans. Autom. Control 19 (1974), 716-723.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft

__all__ = ["autoregression", "spectrum"]

Array = NDArray[np.float64]

_LARGEST_ORDER: Final = 12


def autoregression(
    series: Sequence[Array], criterion: Literal["bayes", "akaike"] = "bayes"
) -> Array:
    """Taps (1, c_1, ..., c_p) of the whitening filter of series with one common noise process.

    The Levinson-Durbin recursion on the biased autocovariance makes every order stable.  The order
    minimises n log(innovation variance) + penalty * order.  White noise gets order zero in most
    cases.

    Args:
        series: Residuals, one (n_sample,) array per record; their mean is not subtracted.
        criterion: Penalty log(n) of Bayes for a noise model, which pays for every order; penalty 2
            of Akaike for a confidence band, which must not miss one.
    """
    count = sum(s.size for s in series)
    if criterion == "bayes":
        largest, penalty = min(_LARGEST_ORDER, count // 20), np.log(max(count, 1))
    else:
        largest, penalty = min(int(10.0 * np.log10(count)), count // 4), 2.0
    lags = np.array(
        [
            sum(
                float(np.einsum("i,i->", s[lag:], s[: s.size - lag]))
                for s in series
                if s.size > lag
            )
            for lag in range(largest + 1)
        ]
    )
    power = lags[0]
    if power <= 0:
        return np.ones(1)
    best = coefficients = np.zeros(0)
    lowest = count * np.log(power)
    for order in range(1, largest + 1):
        predicted = float(np.dot(coefficients, lags[order - 1 : 0 : -1]))
        reflection = (lags[order] - predicted) / power
        coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
        power *= 1.0 - reflection**2
        if power <= 1e-12 * lags[0]:
            best = coefficients
            break
        score = count * np.log(power) + penalty * order
        if score < lowest:
            lowest, best = score, coefficients
    return np.concatenate([[1.0], -best])


def spectrum(taps: Array, length: int) -> Array:
    """Power spectrum of the noise that a filter whitens, on the Fourier grid.

    Args:
        taps: (1 + n_order,) as from `autoregression` [-].
        length: Number of frequencies on the full circle, from zero.

    Returns:
        (length,) power with mean 1; at frequency zero it is the sum of the autocorrelations [-].
    """
    power = 1.0 / np.abs(fft.fft(taps, length)) ** 2
    return np.asarray(power / power.mean(), dtype=np.float64)
