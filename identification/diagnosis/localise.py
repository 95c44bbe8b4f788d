"""Localisation of missing physics by a Kalman filter with unknown disturbances.

Both state equations get an unknown disturbance, a missing voltage and a missing torque,

    L di/dt = ... + e_v,      J dw/dt = ... + e_tau,

each a first-order Gauss-Markov process of unknown intensity and correlation time.  A Kalman filter
of the deviation from the fitted simulation gives the likelihood of the intensities
(`intensities.py`), and a smoother gives the two missing terms over time (`smoothing.py`):

    found = localise(fit)
    found.mechanical.significant, found.missing[0].torque

*Parameters.* The fitted parameters have absorbed part of a missing torque, and with these values a
voltage seems to be missing as well.  The parameters are therefore integrated out under the prior of
the fit, to first order, and the model is linearised a second time at their posterior mean.  A
disturbance that the nominal parameters can reproduce exactly is divided between parameters and
disturbance by prior and correlation time rather than by data; the bands of the traces include this.

*Null hypothesis.* In a complete model each sensor may have white noise and slow noise of unknown
correlation time, and the logged voltage may be noisy; none of these counts as missing.  An
intensity also has to be significant with outliers down-weighted (`outliers.py`).  Intensities and
noise come from unweighted samples, because a jump of a missing term first looks like an outlier.

*Samples.* Intensities are estimated from about 12,000 rows, in segments spread evenly over all
records.  The traces use and cover all rows.

Source: Kristensen, Madsen, Jorgensen, Computers & Chemical Engineering 28 (2004) 225-237; Rauch et
al., AIAA J. 3 (1965) 1445-1450.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from identification.arrays import Array
from identification.diagnosis.deviation import Deviation, Piece, deviation_of
from identification.diagnosis.filtering import Likelihood, likelihood
from identification.diagnosis.intensities import (
    Hyperparameters,
    longest_correlation_time,
    maximum_likelihood,
    p_value_of,
)
from identification.diagnosis.outliers import with_outliers_weighted
from identification.diagnosis.smoothing import smoothed_disturbances
from identification.differences import difference_noise
from identification.fit.solve import Fit

__all__ = ["LEVEL", "Deficiency", "Localisation", "Missing", "localise", "smoothed_terms"]

LEVEL: Final = 0.01
"""Probability that a complete model is found deficient in either equation; each has half of it."""

_COARSE: Final = 4_000
"""Rows of the first estimate."""
_FINE: Final = 12_000
"""Rows of the final estimate."""
_SEGMENT: Final = 600
"""Rows of one segment."""
_WORSE: Final = 3.0
"""Loss of log likelihood at which a linearisation at shifted parameters is rejected."""
_DIFFERENCES: Final = 4
"""Highest order of the differences of a residual."""


@dataclass(frozen=True)
class Deficiency:
    """Missing term of one state equation."""

    unit: Literal["V", "N m"]
    strength: float
    """Intensity (stationary standard deviation) of the missing term [unit]."""
    time_constant: float
    """Correlation time [s]."""
    gain: float
    """Gain of the log likelihood over zero intensity, with the other equation's term allowed in
    both.  A gain far above the significance limit is an overestimate, because the fit with zero
    intensity then stops early."""
    p_value: float
    """Probability of at least this gain for a complete model."""
    significant: bool
    """True if `p_value` is below half of `LEVEL`."""


@dataclass(frozen=True)
class Missing:
    """Smoothed missing voltage and torque over one training record.

    The bands are those of a disturbance that is independent of the signals.  If the missing term
    follows the speed, like friction, the part of it that looks like a change of b is attributed to
    the parameters, and the bands do not include it.  They include the part that the parameters
    cannot reproduce.
    """

    run: int
    """Number of its run."""
    start: int
    """First sample of the record in its run."""
    time: Array
    """(n,) time in the run [s]."""
    voltage: Array
    """(n,) missing voltage on the right of L di/dt [V]."""
    voltage_sd: Array
    """(n,) its posterior standard deviation [V]."""
    torque: Array
    """(n,) missing torque on the right of J dw/dt [N m]."""
    torque_sd: Array
    """(n,) its posterior standard deviation [N m]."""


@dataclass(frozen=True)
class Localisation:
    """Deficiencies of a fitted model."""

    electrical: Deficiency
    """Missing voltage of the armature equation."""
    mechanical: Deficiency
    """Missing torque of the shaft equation."""
    noise: Array
    """(2,) standard deviation of the noise of current and speed, estimated together with the
    significant disturbances so that missing physics does not count as noise [A, rad/s]."""
    missing: tuple[Missing, ...]
    """The missing terms, one per training record."""


def localise(fit: Fit) -> Localisation:
    """Find the deficient equation of a fitted model, with effects or not, and the missing term."""
    deviation, coarse = _started(fit)
    fits = _nested_fits(deviation, _segments(deviation.pieces, _FINE), coarse.point)
    longest = longest_correlation_time(fits.pieces)
    gains = fits.gains
    if any(p_value_of(gain, longest) < 0.5 * LEVEL for gain in gains):
        gains = _gains_without_outliers(deviation, fits, gains)
    both = fits.both
    electrical = _deficiency(deviation, both, 0, gains[0], longest)
    mechanical = _deficiency(deviation, both, 1, gains[1], longest)
    missing = _traces(fit, deviation, both)
    white = fits.chosen(deviation, electrical.significant, mechanical.significant)
    noise = deviation.noise * np.maximum(
        np.hypot(white.intensities[2:4], white.white), _least_noise(deviation)
    )
    return Localisation(electrical, mechanical, np.asarray(noise), missing)


def smoothed_terms(fit: Fit) -> tuple[Missing, ...]:
    """The missing terms of a model known to be deficient, one per training record.

    Neither equation is tested, so that the coarse estimate of the intensities is enough.
    """
    deviation, both = _started(fit)
    return _traces(fit, deviation, both)


def _started(fit: Fit) -> tuple[Deviation, Hyperparameters]:
    """The model linearised at the parameters without the disturbances, and a first estimate."""
    deviation = deviation_of(fit)
    coarse = _segments(deviation.pieces, _COARSE)
    both = maximum_likelihood(deviation, coarse, (True, True))
    known = likelihood(deviation, coarse, both.hyper)
    # Free the first linearisation, so that the rows are in memory only once.
    del deviation, coarse
    return _relinearised(fit, both, known), both


def _traces(fit: Fit, deviation: Deviation, both: Hyperparameters) -> tuple[Missing, ...]:
    """Smoothed missing terms of all records under the intensities."""
    known = likelihood(deviation, deviation.pieces, both.hyper)
    missing = []
    for k, smoothed in enumerate(smoothed_disturbances(deviation, both.hyper, known)):
        record = fit.simulator.records[k]
        e_v, e_tau, v_sd, tau_sd = np.ascontiguousarray(smoothed.T)
        missing.append(Missing(record.run, record.start, record.time, e_v, v_sd, e_tau, tau_sd))
    return tuple(missing)


def _least_noise(deviation: Deviation) -> Array:
    """(2,) lower bound of the sensor noise, from higher differences of the residual.

    If the current follows the voltage within one sample, a strong missing voltage explains white
    noise of the current as well as the sensor does.  A missing term changes slowly or jumps now and
    then; the median of higher differences measures the noise between the jumps.
    """
    channels = [[piece.targets[:, k, 0] for piece in deviation.pieces] for k in range(2)]
    orders = range(1, _DIFFERENCES + 1)
    return np.array([min(difference_noise(own, order) for order in orders) for own in channels])


@dataclass(frozen=True)
class _Nested:
    """Maximum likelihood intensities with both disturbances, and with each one alone."""

    pieces: list[Piece]
    both: Hyperparameters
    torque: Hyperparameters
    voltage: Hyperparameters

    @property
    def gains(self) -> tuple[float, float]:
        """Gains by the missing voltage and by the missing torque, each in addition to the other."""
        return self.both.value - self.torque.value, self.both.value - self.voltage.value

    def chosen(self, deviation: Deviation, electrical: bool, mechanical: bool) -> Hyperparameters:
        """The model without insignificant disturbances, which would absorb coloured noise."""
        if electrical:
            return self.both if mechanical else self.voltage
        if mechanical:
            return self.torque
        return maximum_likelihood(deviation, self.pieces, (False, False), self.torque.point)


def _nested_fits(deviation: Deviation, pieces: list[Piece], start: Array) -> _Nested:
    both = maximum_likelihood(deviation, pieces, (True, True), start)
    torque = maximum_likelihood(deviation, pieces, (False, True), both.point, both.value)
    voltage = maximum_likelihood(deviation, pieces, (True, False), both.point, both.value)
    return _Nested(pieces, both, torque, voltage)


def _gains_without_outliers(
    deviation: Deviation, fits: _Nested, gains: tuple[float, float]
) -> tuple[float, float]:
    """The smaller of the gains with and without down-weighted outliers."""
    known = likelihood(deviation, fits.pieces, fits.both.hyper)
    pieces = with_outliers_weighted(deviation, fits.pieces, fits.both.hyper, known)
    if pieces is None:
        return gains
    again = _nested_fits(deviation, pieces, fits.both.point).gains
    return min(gains[0], again[0]), min(gains[1], again[1])


def _relinearised(fit: Fit, both: Hyperparameters, known: Likelihood) -> Deviation:
    """The model linearised at the posterior mean of the parameters with disturbances allowed.

    The shift is halved if the simulation is too nonlinear to follow all of it.
    """
    value, shift = float(known.value[0]), known.shift[0]
    for share in (1.0, 0.5, 0.25):
        position = np.clip(
            fit.position + share * shift, fit.coordinates.lower, fit.coordinates.upper
        )
        moved = deviation_of(fit, position)
        there = likelihood(moved, _segments(moved.pieces, _COARSE), both.hyper)
        if float(there.value[0]) > value - _WORSE:
            return moved
    return deviation_of(fit)


def _segments(pieces: Sequence[Piece], rows: int) -> list[Piece]:
    """Segments of the records, evenly spread, about `rows` rows in total."""
    total = sum(piece.rows for piece in pieces)
    if total <= 1.5 * rows:
        return list(pieces)
    found = []
    for piece in pieces:
        share = int(rows * piece.rows / total)
        count = max(1, round(share / _SEGMENT))
        length = min(piece.rows, max(share // count, 50))
        starts = np.linspace(0, piece.rows - length, count).astype(int)
        found += [piece.part(int(start), int(start) + length) for start in starts]
    return found


def _deficiency(
    deviation: Deviation, both: Hyperparameters, index: int, gain: float, longest: float
) -> Deficiency:
    gain = max(gain, 0.0)
    p_value = p_value_of(gain, longest)
    return Deficiency(
        unit="N m" if index else "V",
        strength=float(both.intensities[index] * deviation.scale[index]),
        time_constant=float(both.correlation_times[index] * deviation.interval),
        gain=gain,
        p_value=p_value,
        significant=p_value < 0.5 * LEVEL,
    )
