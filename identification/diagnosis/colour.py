"""Autoregressive spectrum of a residual.

A sample autocorrelation is noisy at every lag, and sums over lags accumulate that noise.  An
autoregression with the order of Akaike's criterion is smooth and stable:

    e(t) = sum_i a_i e(t-i) + white noise

White noise gets order zero in most cases; all results are then exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from identification.fit import noise

__all__ = ["autoregression", "spectrum"]

Array = NDArray[np.float64]


def autoregression(residual: Array) -> Array:
    """Coefficients of an autoregression, with the order of Akaike's criterion.

    `identification.fit.noise.autoregression` does the computation; its default criterion is
    stricter.  A noise model pays for every order, but a confidence band must not miss one.

    Args:
        residual: (n_sample,) any unit; its mean is not subtracted.

    Returns:
        (n_order,) coefficients a_i [-]; empty for white noise.

    Source:
        H. Akaike, IEEE Trans. Autom. Control 19 (1974) 716-723.
    """
    size = residual.size
    largest = min(int(10.0 * np.log10(size)), size // 4)
    return -noise.autoregression([residual], largest, penalty=2.0)[1:]


def spectrum(coefficients: Array, length: int) -> Array:
    """Power spectrum of an autoregression on the Fourier grid.

    Args:
        coefficients: (n_order,) as from `autoregression` [-].
        length: Number of frequencies on the full circle, from zero.

    Returns:
        (length,) power with mean 1; at frequency zero it is the sum of the autocorrelations [-].
    """
    transfer = fft.fft(np.concatenate(([1.0], -coefficients)), length)
    power = 1.0 / np.abs(transfer) ** 2
    return np.asarray(power / power.mean(), dtype=np.float64)
