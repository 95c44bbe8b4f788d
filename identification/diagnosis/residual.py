"""Correlations of residuals with confidence bands, and their size: RMSE and NRMSE.

The residual of a complete model is white noise of zero mean, uncorrelated with the voltage.  Every
function takes a list of runs, one array per run.  Runs are not concatenated, so that no correlation
arises across the end of one run and the start of the next:

    current = autocorrelation([residual_of_run_1, residual_of_run_2])
    current.outside            # fraction of lags outside the band; about 1 - level for white noise
    whiteness([residual_of_run_1])                      # p value

The mean of a residual is *not* subtracted: it is zero under the null hypothesis, and a residual
with an offset is not white.

    rmse  = sqrt(mean e^2)                                  e residual
    nrmse = rmse / standard deviation of the measured channel
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, special

from identification.arrays import Array, Index
from identification.fit.autoregression import autoregression, spectrum

__all__ = [
    "Correlation",
    "Errors",
    "autocorrelation",
    "cross_correlation",
    "lagged_products",
    "pooled_errors",
    "whiteness",
]

LEVEL = 0.99
"""Default probability that one lag stays inside the band."""


@dataclass(frozen=True, eq=False)
class Correlation:
    """Correlation function with its confidence band under the null hypothesis."""

    lags: Index
    """(n_lag,) [samples]."""
    values: Array
    """(n_lag,) correlation [-]."""
    half_width: Array
    """(n_lag,) the band is plus and minus this [-]."""
    level: float
    """Probability that one lag stays inside the band under the null hypothesis [-]."""

    @property
    def outside(self) -> float:
        """Fraction of lags outside the band [-]; about ``1 - level`` under the null hypothesis."""
        return float(np.mean(np.abs(self.values) > self.half_width))


@dataclass(frozen=True)
class Errors:
    """Simulation error of one channel."""

    rmse: float
    """Root mean square error, in the unit of the channel."""
    nrmse: float
    """RMSE over the standard deviation of the measured channel [-]."""


def pooled_errors(residuals: Sequence[Array], measured: Sequence[Array]) -> Errors:
    """RMSE and NRMSE over all samples of several runs, one array (n_sample,) per run.

    Squares are summed over the runs.  The variance of each run is taken about its own mean, so that
    the difference between two steady speeds does not improve the NRMSE.

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


def autocorrelation(residuals: Sequence[Array], max_lag: int | None = None) -> Correlation:
    """Autocorrelation of a residual at the lags 1 to `max_lag`, from one array (n_sample,) per run.

        r(k) = sum_t e(t) e(t-k) / sum_t e(t)^2

    The sums include all runs.  The variance of r(k) under white noise is exact for one Gaussian
    run, (n - k) / (n (n + 2)).  For several runs it is combined from their variances, since they
    differ in length and noise.

    By default the last lag is 60 samples, or a quarter of the longest run if that is less.
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
    return _correlation(lags, products, variance, energy, LEVEL)


def cross_correlation(
    residuals: Sequence[Array],
    signals: Sequence[Array],
    max_lag: int | None = None,
    level: float = LEVEL,
) -> Correlation:
    """Cross-correlation of a residual with an input, at negative and positive lags.

        r(k) = sum_t e(t) u(t-k) / sqrt(sum_t e(t)^2 sum_t u(t)^2)

    At positive lags the residual responds to an earlier input.  At negative lags the residual comes
    first, as under feedback.  The inputs of a bench are slow, and the band 1/sqrt(n) is far too
    narrow if the residual is coloured as well.  By Bartlett's formula n var r(k) = sum_j rho_e(j)
    rho_u(j).  The input is known, so its sample correlation is exact.  The noise of a sample rho_e,
    however, would accumulate over thousands of lags.  An autoregression therefore gives rho_e, and
    the sum is computed as an integral of the two spectra, which cannot become negative.

    Residual and input are one array (n_sample,) per run; the mean of the input is subtracted run by
    run.  Lags and level are those of `autocorrelation`.

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
            f"{[signal.size for signal in inputs]}; expected the same number in each run"
        )
    lag = _max_lag(runs, max_lag)
    lags = np.arange(-lag, lag + 1)
    products = np.zeros(lags.size)
    variance = np.zeros(lags.size)
    for run, signal in zip(runs, inputs, strict=True):
        products += lagged_products(run, signal, lag)
        variance += _energy(run) / run.size * _energy(signal) * _spectral_factor(run, signal)
    scale = np.sqrt(sum(_energy(run) for run in runs) * sum(_energy(signal) for signal in inputs))
    return _correlation(lags, products, variance, float(scale), level)


def whiteness(residuals: Sequence[Array]) -> float:
    """P value of the portmanteau test of whiteness (Ljung and Box), one array per run.

        Q = sum_k r(k)^2 / var r(k),   chi-squared with as many degrees of freedom as lags

    For one run this is the Ljung-Box statistic.  For several runs the correlation is pooled first:
    this detects a weak autocorrelation that all runs share, which the sum of the statistics of
    single runs would hide.  No degree of freedom is subtracted, since a simulation error has no
    parameters of a noise model.  There are 20 lags, or a quarter of the longest run if that is
    less.  For a residual that is zero throughout, p is 1.

    Source:
        G. M. Ljung, G. E. P. Box, Biometrika 65 (1978) 297-303.
    """
    runs = _checked(residuals)
    found = autocorrelation(runs, _max_lag(runs, None, usual=20))
    spread = found.half_width / _quantile(found.level)
    known = spread > 0.0
    statistic = float(np.sum((found.values[known] / spread[known]) ** 2))
    freedom = int(np.count_nonzero(known))
    return float(special.chdtrc(freedom, statistic)) if freedom else 1.0


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
    # Not np.dot: at the length of a run its threads cost more than they save.
    return float(np.sum(np.square(run)))


def _quantile(level: float) -> float:
    return float(special.ndtri(0.5 + 0.5 * level))


def lagged_products(run: Array, signal: Array, max_lag: int) -> Array:
    """sum_t e(t) u(t-k), (2 max_lag + 1,), for k from -max_lag to max_lag; zero beyond the run."""
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
    lags: Index, products: Array, variance: Array, scale: float, level: float
) -> Correlation:
    if scale <= 0.0:
        return Correlation(lags, np.zeros(lags.size), np.zeros(lags.size), level)
    half_width = _quantile(level) * np.sqrt(variance) / scale
    return Correlation(lags, products / scale, half_width, level)


def _spectral_factor(run: Array, signal: Array) -> float:
    """sum_j rho_e(j) rho_u(j), as the residual spectrum averaged over the power of the input."""
    length = fft.next_fast_len(2 * run.size, real=True)
    power = np.abs(fft.fft(signal, length)) ** 2
    total = float(power.sum())
    if total <= 0.0:
        return 1.0
    taps = autoregression([run], "akaike")
    return float(np.sum(power * spectrum(taps, length))) / total
