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
from scipy import fft

from identification.arrays import Array

__all__ = ["LARGEST_ORDER", "autoregression", "lag_products", "spectrum"]

LARGEST_ORDER: Final = 12
"""Largest order of a noise model."""


def autoregression(
    series: Sequence[Array],
    criterion: Literal["bayes", "akaike"] = "bayes",
    absorbed: Array | None = None,
) -> Array:
    """Taps (1, c_1, ..., c_p) of the whitening filter of series with one common noise process.

    The Levinson-Durbin recursion on the biased autocovariance makes every order stable.  The order
    minimises n log(innovation variance) + penalty * order.  White noise gets order zero in most
    cases.  The penalty is log(n) (Bayes) for a noise model, which pays for every order, and 2
    (Akaike) for a confidence band, which must not miss one.

    The series are residuals, (n_sample,) per record; their mean is not subtracted.  Their lag
    products are increased by `absorbed`, (LARGEST_ORDER + 1,), those expected of the noise that a
    fit has absorbed.
    """
    count = sum(s.size for s in series)
    if criterion == "bayes":
        largest, penalty = min(LARGEST_ORDER, count // 20), np.log(max(count, 1))
    else:
        largest, penalty = min(int(10.0 * np.log10(count)), count // 4), 2.0
    lags = np.sum([lag_products(each, largest) for each in series], axis=0)
    if absorbed is not None:
        lags = lags + absorbed[: largest + 1]
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


def lag_products(series: Array, largest: int) -> Array:
    """Sums of the products of a series with itself, by lag, (largest + 1,).

    The series is (n_sample,), or (n_sample, n_column), whose columns are summed; lags longer than
    it give zero.
    """
    return np.array(
        [
            float(np.vdot(series[lag:], series[: len(series) - lag])) if lag < len(series) else 0.0
            for lag in range(largest + 1)
        ]
    )


def spectrum(taps: Array, length: int) -> Array:
    """Power spectrum (length,) of the noise that a filter whitens, on the Fourier grid from zero.

    The taps (1 + n_order,) are those of `autoregression`; the power has mean 1, at frequency zero
    it is the sum of the autocorrelations [-].
    """
    power = 1.0 / np.abs(fft.fft(taps, length)) ** 2
    return np.asarray(power / power.mean(), dtype=np.float64)
