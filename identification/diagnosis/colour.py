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

from identification.fit import noise

__all__ = ["autoregression", "spectrum"]

Array = NDArray[np.float64]


def autoregression(residual: Array) -> Array:
    """Coefficients of the autoregression, its order by Akaike's criterion.

    A noise model pays for each order, a band must not forget one: the criterion is more generous
    than that of `identification.fit.noise.autoregression`, which does the work.

    Args:
        residual: (n_sample,) any unit; its mean is not taken away.

    Returns:
        (n_order,) coefficients a_i [-]; empty for white noise.

    Source:
        H. Akaike, IEEE Trans. Autom. Control 19 (1974) 716-723.
    """
    size = residual.size
    largest = min(int(10.0 * np.log10(size)), size // 4)
    return -noise.autoregression([residual], largest, penalty=2.0)[1:]


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
