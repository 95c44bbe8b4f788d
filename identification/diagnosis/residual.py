"""What a residual still knows: correlation with itself and with the inputs, with honest bands.

A residual of a complete model is zero-mean noise that has forgotten its own past and has nothing
in common with the voltage.  Each question is asked of one run or of several at once; a run is an
array, several runs are a list, and runs are never glued together, so that no correlation arises
where one run ends and another begins:

    current = autocorrelation([residual_of_run_1, residual_of_run_2])
    current.outside            # share of lags beyond the band; near 1 - level for white noise
    whiteness([residual_of_run_1]).p_value

The mean of a residual is *not* taken away: under the hypothesis it is zero, and a residual that is
an offset is not white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special, stats

from identification.diagnosis.colour import autoregression, spectrum

__all__ = [
    "Correlation",
    "Whiteness",
    "autocorrelation",
    "cross_correlation",
    "lagged_products",
    "whiteness",
]

Array = NDArray[np.float64]

LEVEL = 0.99


@dataclass(frozen=True, eq=False)
class Correlation:
    """A correlation function with the band in which it stays when nothing is left.

    Args:
        lags: (n_lag,) [samples].
        values: (n_lag,) correlation [-].
        half_width: (n_lag,) the band is plus and minus this [-].
        level: Probability of one lag to fall inside the band under the hypothesis [-].
    """

    lags: NDArray[np.int_]
    values: Array
    half_width: Array
    level: float

    @property
    def outside(self) -> float:
        """Share of lags that leave the band [-]; near ``1 - level`` under the hypothesis."""
        return float(np.mean(np.abs(self.values) > self.half_width))


@dataclass(frozen=True)
class Whiteness:
    """Portmanteau test of no correlation at any of the first lags.

    Args:
        statistic: Sum of squared correlations, each over its variance [-].
        degrees_of_freedom: Number of lags.
        p_value: Probability of a statistic at least as large from white noise [-].
    """

    statistic: float
    degrees_of_freedom: int
    p_value: float


def autocorrelation(
    residuals: Sequence[Array], max_lag: int | None = None, level: float = LEVEL
) -> Correlation:
    """Correlation of a residual with its own past.

        r(k) = sum_t e(t) e(t-k) / sum_t e(t)^2

    Sums run over all runs.  The variance of r(k) under white noise is exact for one Gaussian run,
    (n - k) / (n (n + 2)), and follows from it where runs differ in length and in noise.

    Args:
        residuals: One array (n_sample,) a run, any unit.
        max_lag: Last lag [samples]; by default 60, or a quarter of the longest run where that is
            less.
        level: Probability that one lag stays in the band [-].

    Returns:
        Lags 1 to `max_lag`.
    """
    runs = _checked(residuals)
    lag = _max_lag(runs, max_lag)
    lags = np.arange(1, lag + 1)
    products = sum((lagged_products(run, run, lag)[lag + 1 :] for run in runs), np.zeros(lag))
    energy = sum(_energy(run) for run in runs)
    variance = np.zeros(lag)
    for run in runs:
        pairs = np.maximum(run.size - lags, 0)
        variance += _energy(run) ** 2 * pairs / (run.size * (run.size + 2.0))
    return _correlation(lags, products, variance, energy, level)


def cross_correlation(
    residuals: Sequence[Array],
    signals: Sequence[Array],
    max_lag: int | None = None,
    level: float = LEVEL,
) -> Correlation:
    """Correlation of a residual with an input, before and after.

        r(k) = sum_t e(t) u(t-k) / sqrt(sum_t e(t)^2 sum_t u(t)^2)

    At positive lags the residual answers an earlier input, at negative lags the residual comes
    first, as it does under feedback.  Inputs of a bench are slow, and the plain band of 1/sqrt(n)
    is far too narrow as soon as the residual is coloured too.  By Bartlett's formula
    n var r(k) = sum_j rho_e(j) rho_u(j).  The input is known, so its sample correlation is exact
    here; the noise in a sample rho_e, however, adds up over thousands of lags.  It is therefore
    taken from an autoregression, and the sum is done as an integral of the two spectra, which
    cannot turn negative.

    Args:
        residuals: One array (n_sample,) a run, any unit.
        signals: The input of the same runs, (n_sample,) each; its mean is taken away run by run.
        max_lag: Last lag [samples]; by default 60, or a quarter of the longest run where that is
            less.
        level: Probability that one lag stays in the band [-].

    Returns:
        Lags ``-max_lag`` to ``max_lag``.

    Raises:
        ValueError: Residuals and signals differ in number or length.

    Source:
        M. S. Bartlett, J. R. Statist. Soc. Suppl. 8 (1946) 27-41.
    """
    runs = _checked(residuals)
    inputs = [signal - signal.mean() for signal in _checked(signals)]
    if [run.size for run in runs] != [signal.size for signal in inputs]:
        raise ValueError(
            f"residuals have {[run.size for run in runs]} samples, signals "
            f"{[signal.size for signal in inputs]}; expected the same for each run"
        )
    lag = _max_lag(runs, max_lag)
    lags = np.arange(-lag, lag + 1)
    products = np.zeros(lags.size)
    variance = np.zeros(lags.size)
    for run, signal in zip(runs, inputs, strict=True):
        products += lagged_products(run, signal, lag)
        variance += _energy(run) / run.size * _energy(signal) * _colour_factor(run, signal)
    scale = np.sqrt(sum(_energy(run) for run in runs) * sum(_energy(signal) for signal in inputs))
    return _correlation(lags, products, variance, float(scale), level)


def whiteness(residuals: Sequence[Array], lags: int | None = None) -> Whiteness:
    """Whether a residual is white noise, as one number.

        Q = sum_k r(k)^2 / var r(k),   chi-squared with as many degrees of freedom as lags

    For one run this is the statistic of Ljung and Box.  For several runs the correlation is pooled
    first: a weak colour that all runs share then shows, where adding up the statistics of single
    runs would drown it.  No degree of freedom is taken off, since a simulation error has no
    parameters of a noise model.

    Args:
        residuals: One array (n_sample,) a run, any unit.
        lags: Number of lags; by default 20, or a quarter of the longest run where that is less.

    Returns:
        Statistic, degrees of freedom and p value; p is 1 for a residual that is zero throughout.

    Source:
        G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297-303.
    """
    runs = _checked(residuals)
    found = autocorrelation(runs, _max_lag(runs, lags, usual=20))
    spread = found.half_width / _quantile(found.level)
    known = spread > 0.0
    statistic = float(np.sum((found.values[known] / spread[known]) ** 2))
    freedom = int(np.count_nonzero(known))
    p_value = float(stats.chi2.sf(statistic, freedom)) if freedom else 1.0
    return Whiteness(statistic, freedom, p_value)


def _checked(runs: Sequence[Array]) -> list[Array]:
    arrays = [np.asarray(run, dtype=np.float64) for run in runs]
    for number, array in enumerate(arrays):
        if array.ndim != 1 or array.size < 2 or not np.all(np.isfinite(array)):
            raise ValueError(
                f"run {number} of {len(arrays)} has shape {array.shape} or holds a value that is "
                "not finite; expected at least two finite samples along one axis"
            )
    if not arrays:
        raise ValueError("no runs given; expected at least one")
    return arrays


def _max_lag(runs: Sequence[Array], asked: int | None, usual: int = 60) -> int:
    longest = max(run.size for run in runs)
    return min(asked if asked is not None else min(usual, max(longest // 4, 1)), longest - 1)


def _energy(run: Array) -> float:
    # Not np.dot: its threads cost more than they save at the length of a run.
    return float(np.sum(np.square(run)))


def _quantile(level: float) -> float:
    return float(special.ndtri(0.5 + 0.5 * level))


def lagged_products(run: Array, signal: Array, max_lag: int) -> Array:
    """sum_t e(t) u(t-k) for k from -max_lag to max_lag; zero where the lag exceeds the run.

    Args:
        run: (n_sample,) e.
        signal: (n_sample,) u.
        max_lag: Last lag [samples].

    Returns:
        (2 max_lag + 1,)
    """
    length = fft.next_fast_len(run.size + max_lag, real=True)
    spectrum = fft.rfft(run, length) * np.conj(fft.rfft(signal, length))
    circular = fft.irfft(spectrum, length)
    found = np.zeros(2 * max_lag + 1)
    reach = min(max_lag, run.size - 1)
    found[max_lag : max_lag + reach + 1] = circular[: reach + 1]
    if reach:
        found[max_lag - reach : max_lag] = circular[-reach:]
    return found


def _correlation(
    lags: NDArray[np.int_], products: Array, variance: Array, scale: float, level: float
) -> Correlation:
    if scale <= 0.0:
        return Correlation(lags, np.zeros(lags.size), np.zeros(lags.size), level)
    half_width = _quantile(level) * np.sqrt(variance) / scale
    return Correlation(lags, products / scale, half_width, level)


def _colour_factor(run: Array, signal: Array) -> float:
    """sum_j rho_e(j) rho_u(j), as the mean residual spectrum seen through the input's power."""
    length = fft.next_fast_len(2 * run.size, real=True)
    power = np.abs(fft.fft(signal, length)) ** 2
    total = float(power.sum())
    if total <= 0.0:
        return 1.0
    return float(np.sum(power * spectrum(autoregression(run), length))) / total
