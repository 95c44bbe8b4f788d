"""Autoregressive spectrum of a residual.

A sample autocorrelation is noisy at every lag, and sums over lags accumulate that noise.  An
autoregression is smooth and stable; with the order of Akaike's criterion, white noise gets order
zero in most cases, and all results are then exact.

Source: Akaike, IEEE Trans. Automatic Control 19 (1974), 716-723.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from identification.fit.noise import autoregression

__all__ = ["akaike_filter", "spectrum"]

Array = NDArray[np.float64]


def akaike_filter(residual: Array) -> Array:
    """Whitening filter (1, -a1, ..., -ap) with the order of Akaike's criterion.

    The default criterion of `autoregression` is stricter: a noise model pays for every order, but a
    confidence band must not miss one.

    Args:
        residual: (n_sample,) any unit; its mean is not subtracted.
    """
    largest = min(int(10.0 * np.log10(residual.size)), residual.size // 4)
    return autoregression([residual], largest, penalty=2.0)


def spectrum(taps: Array, length: int) -> Array:
    """Power spectrum of the noise that a filter whitens, on the Fourier grid.

    Args:
        taps: Whitening filter (1, -a1, ..., -ap) [-].
        length: Number of frequencies on the full circle, from zero.

    Returns:
        (length,) power with mean 1; at frequency zero it is the sum of the autocorrelations [-].
    """
    power = 1.0 / np.abs(fft.fft(taps, length)) ** 2
    return np.asarray(power / power.mean(), dtype=np.float64)
