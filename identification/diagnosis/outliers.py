"""Detection of isolated outliers: spikes of a sensor, its cable or its converter.

The scale is the median absolute deviation times 1.4826, an estimate of the standard deviation of
normal noise that is robust against outliers (Rousseeuw and Croux, Journal of the American
Statistical Association 88 (1993), 1273-1283).  A normal residual exceeds ten standard deviations
once in 10^23 samples.  A sample counts only if its neighbours deviate much less: if the time
constants of the motor exceed the sample interval, a real deviation of the motor includes the
neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.evaluate import Simulated
from identification.warning import ResultWarning

__all__ = ["outlier_warnings"]

Array = NDArray[np.float64]

_NORMAL: Final = 1.4826
"""Standard deviation of normal noise over its median absolute deviation."""
_FAR: Final = 10.0
"""Deviation of an outlier at least, in standard deviations."""
_BESIDE: Final = 0.5
"""Largest deviation of a neighbour, over that of the sample."""
_SHARE: Final = 0.5
"""Fraction of the squared error from which the outliers decide the noise estimate."""
_CHANNELS: Final = (("current_A", "A"), ("speed_rad_s", "rad/s"))


def outlier_warnings(simulated: Sequence[Simulated]) -> list[ResultWarning]:
    """Warnings for channels in which isolated outliers cause more than half of the squared error.

    Args:
        simulated: Training records with their simulation.
    """
    warnings = []
    for channel, (column, unit) in enumerate(_CHANNELS):
        pieces = [
            (s.record.name, s.residual[s.record.weight[:, channel] > 0, channel]) for s in simulated
        ]
        residual = np.concatenate([piece for _, piece in pieces])
        if not residual.size:
            continue
        scale = _NORMAL * float(np.median(np.abs(residual - np.median(residual))))
        alone = np.concatenate([_alone(piece, _FAR * scale) for _, piece in pieces])
        rest = float(np.sum(residual[~alone] ** 2))
        if scale <= 0.0 or rest > (1.0 - _SHARE) * float(np.sum(residual**2)):
            continue
        names = [name for name, piece in pieces if _alone(piece, _FAR * scale).any()]
        farthest = float(np.abs(residual[alone]).max())
        whole = float(np.sqrt(np.mean(residual**2)))
        message = (
            f"{', '.join(dict.fromkeys(names))}, column {column}: {int(alone.sum())} isolated "
            f"outliers: the residual exceeds {_FAR:g} standard deviations of the noise (largest "
            f"{farthest:.3g} {unit}), the residuals of the neighbouring samples are less than half "
            f"as large; the noise is {scale:.3g} {unit} without and {whole:.3g} {unit} with these "
            "samples, so intervals may be too narrow"
        )
        fix = "check sensor, cable and converter, or remove these samples"
        warnings.append(ResultWarning("isolated_outliers", "warning", message, fix))
    return warnings


def _alone(residual: Array, far: float) -> NDArray[np.bool_]:
    """Samples beyond a limit whose neighbours deviate by less than half as much."""
    size = np.abs(residual)
    padded = np.pad(size, 1)
    beside = np.maximum(padded[:-2], padded[2:])
    return np.asarray((size > far) & (beside < _BESIDE * size))
