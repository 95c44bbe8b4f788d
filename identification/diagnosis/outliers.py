"""Outliers: warnings of outlying runs and isolated samples, weights in the Kalman filter.

*Runs.* The error of an outlying run is far above the median error of the other runs: another motor,
another load, or a sensor fault.

*Samples.* The scale is the median absolute deviation times 1.4826, a robust estimate of the
standard deviation of normal noise.  A normal residual exceeds ten standard deviations once in 10^23
samples.  A sample counts only if its neighbours deviate much less: if the time constants of the
motor exceed the sample interval, a real deviation of the motor includes the neighbours.  If the
outliers coincide with steps of the logged voltage, its timing is wrong and no sensor: a loop that
sets the voltage, waits and then logs both shifts it by one sample, and a source that is not
synchronous with the log steps between two samples.

*Weights.* An outlier is not missing physics, but a filter for normal noise would explain it by a
short burst of voltage.  Samples far from their prediction by all others are weighted under a
Student-t law and never deleted.  This is done only if that law is clearly better than the normal
one.

Source: Rousseeuw and Croux, J. American Statistical Association 88 (1993), 1273-1283 (scale);
Lange, Little and Taylor, ibid. 84 (1989), 881-896 (Student-t weights).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array, Bool
from identification.diagnosis.deviation import Deviation, Piece
from identification.diagnosis.filtering import Likelihood
from identification.diagnosis.smoothing import auxiliary_residuals
from identification.fit.evaluate import Simulated
from identification.fit.noise import student_weights
from identification.model.excitation import rms_of
from identification.warning import ResultWarning

__all__ = [
    "noise_without_outlying_runs",
    "outlier_warnings",
    "outlying_run_warnings",
    "root_mean_square",
    "with_outliers_weighted",
]

_RUN_RATIO: Final = 2.0
"""Error of an outlying run over the median error of the other runs, at least."""
_RUN_NOISE: Final = 1.5
"""Error of an outlying run over the noise, at least."""
_NORMAL: Final = 1.4826
"""Standard deviation of normal noise over its median absolute deviation."""
_DEVIATIONS: Final = 10.0
"""Deviation of an outlier at least, in standard deviations."""
_NEIGHBOUR: Final = 0.5
"""Largest deviation of a neighbour, over that of the sample."""
_SHARE: Final = 0.5
"""Fraction of the squared error from which the outliers decide the noise estimate."""
_LEVEL: Final = 0.01
"""Probability by chance, up to which outliers are attributed to the steps of the voltage."""
_CHANNELS: Final = (("current_A", "A"), ("speed_rad_s", "rad/s"))


def outlying_run_warnings(simulated: Sequence[Simulated], noise: Array) -> list[ResultWarning]:
    """Warnings for training runs whose error is far larger than that of the others."""
    names = list(dict.fromkeys(s.record.name for s in simulated))
    reasons: dict[str, list[str]] = {}
    for channel, word in enumerate(("current", "speed")):
        ratios = _errors(simulated, channel) / max(float(noise[channel]), 1e-300)
        medians = _medians_of_others(ratios)
        for k in np.flatnonzero(ratios > np.maximum(_RUN_NOISE, _RUN_RATIO * medians)):
            reason = (
                f"RMS error of the {word} {ratios[k]:.3g} times the sensor noise, median of the "
                f"other runs {medians[k]:.3g}"
            )
            reasons.setdefault(names[k], []).append(reason)
    fix = "check motor, load and sensors of this run, or omit it from the fit"
    return [
        ResultWarning("outlying_run", "warning", f"{name}: outlying run: {'; '.join(found)}", fix)
        for name, found in reasons.items()
    ]


def noise_without_outlying_runs(simulated: Sequence[Simulated], noise: Array) -> Array:
    """(2,) noise of current and speed without the excess error of outlying runs [A, rad/s]."""
    found = noise.copy()
    for channel in range(2):
        errors = _errors(simulated, channel)
        fitting = ~(errors > _RUN_RATIO * _medians_of_others(errors))
        if not fitting.all():
            found[channel] = min(found[channel], float(np.median(errors[fitting])))
    return found


def root_mean_square(simulated: Sequence[Simulated]) -> Array:
    """(2,) RMS error of current and speed over all records [A, rad/s]."""
    return rms_of([s.record for s in simulated], [s.residual for s in simulated])


def _medians_of_others(errors: Array) -> Array:
    """(n_run,) median error of the other runs; infinite if there are none."""
    others = [np.delete(errors, k) for k in range(errors.size)]
    return np.array([np.median(each) if each.size else np.inf for each in others])


def _errors(simulated: Sequence[Simulated], channel: int) -> Array:
    """(n_run,) RMS error of each run; zero if nothing was measured."""
    found: dict[str, list[Array]] = {}
    for s in simulated:
        kept = s.record.weight[:, channel] > 0
        found.setdefault(s.record.name, []).append(s.residual[kept, channel])
    errors = [np.concatenate(pieces) for pieces in found.values()]
    return np.array([np.sqrt(np.mean(e**2)) if e.size else 0.0 for e in errors])


def outlier_warnings(simulated: Sequence[Simulated]) -> list[ResultWarning]:
    """Warnings for channels in which outliers cause more than half of the squared error."""
    warnings = []
    for channel, (column, unit) in enumerate(_CHANNELS):
        kept = [s.record.weight[:, channel] > 0 for s in simulated]
        pieces = [s.residual[keep, channel] for s, keep in zip(simulated, kept, strict=True)]
        residual = np.concatenate(pieces)
        if not residual.size:
            continue
        scale = _NORMAL * float(np.median(np.abs(residual - np.median(residual))))
        isolated = [_is_isolated(piece, _DEVIATIONS * scale) for piece in pieces]
        outlying = np.concatenate(isolated)
        others = float(np.sum(residual[~outlying] ** 2))
        if scale <= 0.0 or others > (1.0 - _SHARE) * float(np.sum(residual**2)):
            continue
        names = [s.record.name for s, own in zip(simulated, isolated, strict=True) if own.any()]
        files = ", ".join(dict.fromkeys(names))
        largest = float(np.abs(residual[outlying]).max())
        steps = [
            _steps(s.record.column("voltage"))[keep]
            for s, keep in zip(simulated, kept, strict=True)
        ]
        if _coincide(outlying, np.concatenate(steps)):
            warnings.append(_of_timing(files, column, f"{largest:.3g} {unit}"))
            continue
        whole = float(np.sqrt(np.mean(residual**2)))
        message = (
            f"{files}, column {column}: {int(outlying.sum())} isolated "
            f"outliers: the residual exceeds {_DEVIATIONS:g} standard deviations of the noise "
            f"(largest {largest:.3g} {unit}), the residuals of the neighbouring samples are less "
            f"than half as large; the noise is {scale:.3g} {unit} without and {whole:.3g} {unit} "
            "with these samples, so intervals may be too narrow"
        )
        fix = "check sensor, cable and converter, or remove these samples"
        warnings.append(ResultWarning("isolated_outliers", "warning", message, fix))
    return warnings


def _of_timing(files: str, column: str, largest: str) -> ResultWarning:
    message = (
        f"{files}, column voltage_V: the samples in which the voltage steps fit worst (residual of "
        f"{column} up to {largest}), the others fit: the row of a step does not show when the "
        "motor received it, as in a loop that sets the voltage, waits, and then logs it with the "
        "response, or from a source that is not synchronous with the log"
    )
    fix = (
        "log in each row the voltage that is set after its samples were taken, or move the voltage "
        "column by one row; of a source that steps between the samples, log more samples; keep "
        "these samples"
    )
    return ResultWarning("voltage_step_timing", "warning", message, fix)


def _steps(voltage: Array) -> Array:
    """(n,) change of the voltage (n,) from the sample before [V]."""
    return np.asarray(np.abs(np.diff(voltage, prepend=voltage[:1])))


def _coincide(outlying: Bool, steps: Array) -> bool:
    """True if the voltage steps at all outliers by more than it would by chance.

    The probability that all of n samples are among the fraction f with the largest changes is f^n.
    """
    least = float(np.min(steps[outlying]))
    share = float(np.mean(steps >= least))
    return least > 0.0 and share ** int(np.count_nonzero(outlying)) < _LEVEL


def _is_isolated(residual: Array, limit: float) -> Bool:
    """Samples beyond a limit whose neighbours deviate by less than half as much."""
    size = np.abs(residual)
    padded = np.pad(size, 1)
    neighbour = np.maximum(padded[:-2], padded[2:])
    return np.asarray((size > limit) & (neighbour < _NEIGHBOUR * size))


def with_outliers_weighted(
    deviation: Deviation, pieces: Sequence[Piece], hyper: Array, known: Likelihood
) -> list[Piece] | None:
    """The pieces with outliers down-weighted; None if the noise is normal.

    `hyper` (n_hyper, 1) holds the hyperparameters, see `HYPER`, `known` the posterior of the
    parameters under them.
    """
    residuals = auxiliary_residuals(deviation, pieces, hyper, known)
    found = student_weights(residuals, [piece.weight for piece in pieces])
    if found is None:
        return None
    return [replace(piece, weight=piece.weight * w) for piece, w in zip(pieces, found, strict=True)]
